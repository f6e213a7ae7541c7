if __name__ != "nathlon.reports":
    raise ModuleNotFoundError("import nathlon.reports in place of reports", name="reports")

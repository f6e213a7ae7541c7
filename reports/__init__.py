if __name__ != "nathlon.reports":
    raise ModuleNotFoundError("import nathlon.reports instead of reports", name="reports")

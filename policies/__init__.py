if __name__ != "nathlon.policies":
    raise ModuleNotFoundError("import nathlon.policies in place of policies", name="policies")

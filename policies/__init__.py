if __name__ != "nathlon.policies":
    raise ModuleNotFoundError("import nathlon.policies instead of policies", name="policies")

if __name__ != "nathlon.arena":
    raise ModuleNotFoundError("import nathlon.arena in place of arena", name="arena")

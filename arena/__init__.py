if __name__ != "nathlon.arena":
    raise ModuleNotFoundError("import nathlon.arena instead of arena", name="arena")

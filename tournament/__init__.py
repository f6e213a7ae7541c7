if __name__ != "nathlon.tournament":
    raise ModuleNotFoundError("import nathlon.tournament instead of tournament", name="tournament")

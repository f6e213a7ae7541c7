if __name__ != "nathlon.tournament":
    raise ModuleNotFoundError("import nathlon.tournament in place of tournament", name="tournament")

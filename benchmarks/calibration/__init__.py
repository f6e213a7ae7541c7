"""Whether the selection's statistics keep their word on races of the simulator."""

"""The fastest lap that a car's own equations and the rules allow, by optimal control: the extra `limit`."""

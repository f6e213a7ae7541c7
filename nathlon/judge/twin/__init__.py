"""Two races from one start: a recorded one, and one that went otherwise."""

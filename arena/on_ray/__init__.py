"""A Ray cluster as a crew: an actor on every node, around a pool of its own."""

"""A Ray cluster as an executor: an actor on every node, around a pool of its own."""

"""Recipes: how well a way of training does, over its seeds, and not its luckiest checkpoint."""

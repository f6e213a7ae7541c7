"""Rewards from words: formulas are proposed, filtered, trained, compared, and the best ones bred."""

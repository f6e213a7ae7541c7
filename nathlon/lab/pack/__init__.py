"""A run as one file that others can check: what it claims, what that rests on, and who says so."""

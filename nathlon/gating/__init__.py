"""The gate: whether a candidate may take the champion's place, being no worse than it in anything that counts."""

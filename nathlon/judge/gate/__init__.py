"""Whether a candidate may take the champion's place: no worse than it in anything that counts."""

"""What comes out of a selection, a gate, a matrix and the like, as plain values."""

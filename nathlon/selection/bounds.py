"""The most that may be asked for, on the command line and in a configuration."""

LARGEST_SEED = 2**63 - 1
"""What stores and recordings have room for."""
MOST_WORKERS = 1024
MOST_SHORTLISTED = 1000
MOST_PAIRS = 10_000
"""Mirrored pairs of races of two entrants."""

"""How often each verdict makes a claim that is false, by kinds of noise: see `__main__`."""

"""Planning around a policy, measured; see `benchmarks.mppi.__main__`."""

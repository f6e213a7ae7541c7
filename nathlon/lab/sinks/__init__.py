"""Sinks: where the results of a night go besides its folder, each in a process of its own."""

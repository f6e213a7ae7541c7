"""Plans of stops: what a car's laps cost on each compound, and which stints are fastest."""

"""The committee's room in a browser: what its members see, and what they can say there."""

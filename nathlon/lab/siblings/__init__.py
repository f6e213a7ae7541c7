"""Training runs beside each other: each saves, says how it does, and ends when it is proved worse."""

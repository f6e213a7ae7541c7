"""The coach: where a recorded car lost time and why, and what is faster there, driven again to prove it."""

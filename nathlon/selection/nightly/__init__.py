"""Nights: selections among what is new in the watched folders, and the best of the nights before."""

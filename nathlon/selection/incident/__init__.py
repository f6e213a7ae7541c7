"""Incidents of recorded races, frozen as tests that every later night runs."""

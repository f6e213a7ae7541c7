"""Test drives: a person races policies in a browser."""

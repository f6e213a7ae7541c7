"""Readers of files that describe circuits, a module for each family: from text to plain arrays.

They check what a file says, not what a road can be, and raise InputError without its path.
"""

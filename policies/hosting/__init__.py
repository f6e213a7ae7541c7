"""Processes that this one hosts: how they start, what they are asked, and how they end.

`child` holds foreign code, in this interpreter or another, and answers messages of `wire`. `spawned` does our
own work through `multiprocessing`. `programs` are all others.
"""

"""What the commands do, with their progress and their words to the user.

Each is imported only when it runs: the whole of the libraries takes seconds to load.
"""

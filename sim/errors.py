"""The error that a user's own input can cause."""


class InputError(Exception):
    """Bad input: one sentence naming the file, the field and what was expected.

    The command line prints it as it is and exits with code 2.
    """

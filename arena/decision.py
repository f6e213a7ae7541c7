"""What a test that may run out of races says."""

from enum import StrEnum


class Decision(StrEnum):
    """Of a candidate that has to be no worse than another policy."""

    PASS = "pass"
    FAIL = "fail"
    CANNOT_TELL = "cannot tell"

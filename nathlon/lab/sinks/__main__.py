"""The process of a sink: reads its job, delivers it, and says in one line what became of it."""

from __future__ import annotations

import json
import os
import sys

from nathlon.lab.sinks.registry import SINKS
from nathlon.lab.sinks.secrets import concealed, revealed


def main(sink: str) -> None:
    """Deliver what standard input says."""
    # Only this process may answer: libraries print, and what they start would keep the pipe open.
    with os.fdopen(os.dup(1), "w") as answer:
        os.dup2(2, 1)
        told, address = json.load(sys.stdin)
        try:
            address = revealed(address)
            takes, deliver = SINKS[sink]
            place, error = deliver(takes.model_validate(told), address), None
        except (Exception, SystemExit) as fault:
            place, error = None, concealed(str(fault) or type(fault).__name__, address).rstrip(".")
        json.dump([place and concealed(place, ""), error], answer)


if __name__ == "__main__":
    main(sys.argv[1])

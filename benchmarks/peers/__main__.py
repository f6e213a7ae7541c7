"""`python -m benchmarks.peers [--install]`: fetch the peers, or measure those that are there."""

from __future__ import annotations

import argparse
import json

from rich.console import Console

from benchmarks.peers import measure
from benchmarks.peers.install import install


def main() -> None:
    """Fetch the peers, or print the figures of those found as JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__)
    parser.add_argument("--install", action="store_true", help="fetch the peers that packages offer")
    console = Console(stderr=True)
    if parser.parse_args().install:
        install(console)
    else:
        print(json.dumps(measure(console)))


if __name__ == "__main__":
    main()

"""What it costs that a policy gets memory and random generators of its own, as a share of its match's time.

One 4v4 match of bundled checkpoints is run as they are, and with each behind a class of no known kind, as a
plugin is; then what is done for each answer beside asking is timed as often as it was done, on the same data.

    python -m benchmarks.isolation --json FILE
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from benchmarks.result import write_result
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.runner import run_match
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.isolation import Apart
from nathlon.policies.policy import Batch, Policy
from nathlon.policies.sources.identity import policy_id

PLACE = ("lindenring", "gt3")
NAMES = ("lindenring-mend-059k", "lindenring-again-056k")
RACES = 8


class Counted:
    """A policy of no known kind that counts how often it is asked, and about how many cars."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self.observation_spec = policy.observation_spec
        self.asked: list[Batch] = []

    def initial_memory(self, n: int) -> Batch:
        return self._policy.initial_memory(n)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        self.asked.append(observations)
        return self._policy.act(observations, memory)


def match() -> Match:
    """Eight races of four cars against four."""
    sources = tuple(str(BUNDLED / PLACE[0] / f"{name}.safetensors") for name in NAMES)
    seats = tuple(Seat(slot % 2, slot % 2) for slot in range(8))
    races = tuple(Race(seed, seats) for seed in range(RACES))
    return Match("t", "t", "race", *PLACE, tuple(map(policy_id, sources)), sources, races)


def main() -> None:
    """Print and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.isolation", description=__doc__)
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    run, policies = match(), match_policies(match())
    run_match(run, policies)  # compiles
    began = time.process_time()
    run_match(run, policies)
    match_s = time.process_time() - began
    counted = [Counted(policy) for policy in policies]
    run_match(run, counted)
    asked = [seen for policy in counted for seen in policy.asked]
    began = time.process_time()
    for seen in asked:
        np.array(seen)
    copies_s = time.process_time() - began
    apart = Apart(1)
    began = time.process_time()
    for _ in asked:
        with apart.entered():
            pass
    generators_s = time.process_time() - began
    figures = {
        "answers": len(asked),
        "match_cpu_s": round(match_s, 3),
        "copies_share": round(copies_s / match_s, 4),
        "generators_share": round(generators_s / match_s, 4),
    }
    print(figures)
    if options.json:
        write_result(options.json, figures)


if __name__ == "__main__":
    main()

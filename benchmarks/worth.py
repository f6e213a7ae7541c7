"""What selecting is worth: who is sent against whom one would have sent without it.

`python -m benchmarks.worth --json FILE` selects among the bundled checkpoints of every circuit as
`nathlon evaluate` does. Then the one that is sent, the last checkpoint (most transitions) and the fastest
(best mean lap of the time trials) race each other 4v4, in mirrored pairs on seeds that the selection has
not seen.

Figures, by circuit: names of `sent`, `last` and `fastest`, `races` of every two, and `over_last` and
`over_fastest`: how many points a race the one sent makes more than the other, `difference` with
`difference_low` and `difference_high` (95 %); none where they are one.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

import nathlon
from benchmarks.result import write_result
from nathlon.arena.entrance import enter_all, trained_on
from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.load import load_file
from nathlon.progress import worker_count
from nathlon.selection.config import Config
from nathlon.selection.round_robin import tournament_matches
from nathlon.tournament.points import matchups

FRESH = 20_261_125
"""Seed of the races that judge; selections have others."""
PAIRS = 48


def main() -> None:
    """Select on every circuit, race, and keep the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.worth", description="What selecting is worth")
    parser.add_argument("--json", type=Path, required=True, help="where the figures go")
    chosen = parser.parse_args()
    circuits = sorted(folder.name for folder in BUNDLED.iterdir() if any(folder.glob("*.safetensors")))
    write_result(chosen.json, {circuit: measure(circuit) for circuit in circuits})


def measure(circuit: str) -> dict[str, Any]:
    """The figures of a circuit."""
    with tempfile.TemporaryDirectory() as out:
        config = Config(recordings="notable")
        result = nathlon.select(BUNDLED / circuit, out, config=config, progress=False)
        pareto, [sent] = result.pareto, result.sent
    laps = pareto.drop_nulls("lap_s").sort("lap_s")
    files = sorted((BUNDLED / circuit).glob("*.safetensors"))
    last = max(files, key=lambda path: load_file(path).card.transitions or 0).stem
    fastest = str(laps["name"][0])
    names = list(dict.fromkeys([sent, last, fastest]))
    with Pool(worker_count(None)) as pool:
        sources = [str(BUNDLED / circuit / f"{name}.safetensors") for name in names]
        entrants = enter_all(pool, sources, *trained_on(pool, sources))
        raced = _matchups(pool, entrants)
    return {
        "sent": sent,
        "last": last,
        "fastest": fastest,
        "races": 2 * PAIRS,
        "over_last": _over(raced, entrants, sent, last),
        "over_fastest": _over(raced, entrants, sent, fastest),
    }


def _matchups(pool: Pool, entrants: Sequence[Entrant]) -> pl.DataFrame:
    matches = tournament_matches(entrants, PAIRS, np.random.SeedSequence(FRESH))
    results = pl.concat([results for _, results in pool.run(matches)])
    return matchups(results, np.random.default_rng(FRESH))


def _over(raced: pl.DataFrame, entrants: Sequence[Entrant], one: str, other: str) -> dict[str, float] | None:
    """By how much one beats another; None where they are the same."""
    ids = {entrant.name: entrant.id for entrant in entrants}
    found = raced.filter((pl.col("entrant") == ids[one]) & (pl.col("opponent") == ids[other]))
    columns = ("difference", "difference_low", "difference_high")
    return {name: round(found[name][0], 2) for name in columns} if found.height else None


if __name__ == "__main__":
    main()

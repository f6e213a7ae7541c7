"""Whether the tournament's statistics keep their word on races of the simulator.

Run as `python -m benchmarks.calibration [--json FILE] [--tournaments 100] [--pool 100] [--pairs 24]`; the
last line of the output is one JSON object.

The champion of a bundled ladder races itself, 4v4, from a standing start to the exit of the first corners, in
`pool` mirrored pairs. Their two races are not the same: matrix products round differently with a car's place
among the rows, and races are chaotic. From these pairs, with the two sides dealt by lot, tournaments of equal
entrants are drawn and judged as the tournament stage does it, in rounds, with stopping. By number of entrants
under `equal`:

- `coverage`: share of the entrants' intervals that hold the truth, the mean of team points;
- `false_accept`: share of tournaments in which any two entrants get different ranks; with its 95 % interval
  `false_accept_low`, `false_accept_high`;
- `pairs_share`: pairs that these raced, of their cap.

It then meets the checkpoint before it in `pairs` mirrored pairs of the scenario `race`; under `champion`:

- `t`: mean difference over standard deviation of those pairs;
- `pairs_sequential`: pairs after which the sequential test ends, on average over pairs drawn from them;
- `pairs_fixed`: pairs that a t-test with the same errors and `effect` needs, decided beforehand.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from scipy.special import ndtri
from scipy.stats import binomtest

from benchmarks.result import write_result
from nathlon.arena.entrant import Entrant, enter, only_once
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import run_matches
from nathlon.arena.results import RESULTS
from nathlon.arena.runner import run_match
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.load import load_policy
from nathlon.selection.round_robin import TournamentSettings, tournament_matches
from nathlon.selection.run import CONFIDENCE
from nathlon.tournament.evidence import appearances, differences
from nathlon.tournament.formats import FORMATS
from nathlon.tournament.points import EQUAL, TEAM_POINTS, rank
from nathlon.tournament.stopping import OPEN, Stopping, repeated, settled

LADDER, CIRCUIT, CAR = "lindenring-s1", "lindenring", "gt3"
SHORT = "standing_start"
SIZES = (2, 4, 8)
SEED = 2024
SHUFFLES = 500
SETTINGS = TournamentSettings()
STOPPING = Stopping(SETTINGS.effect, SETTINGS.drop)

Pairs = list[pl.DataFrame]
"""RESULTS of mirrored pairs, one a frame."""


def ladder() -> list[Entrant]:
    """The last two checkpoints, the champion last."""
    paths = sorted((BUNDLED / CIRCUIT).glob(f"{LADDER}-*.safetensors"))[-2:]
    return only_once([enter(str(path), CIRCUIT, CAR) for path in paths])


def against_itself(entrant: Entrant, pairs: int) -> Pairs:
    """Mirrored pairs of a policy in both teams."""
    made = FORMATS[SETTINGS.format]
    races = [
        Race(seed, tuple(Seat(side, side) for side in grid.sides), grid.mirrored)
        for seed in range(pairs)
        for grid in made.grids(2)
    ]
    names, sources = ("home", "away"), (entrant.source, entrant.source)
    match = Match("tournament", SHORT, SHORT, CIRCUIT, CAR, names, sources, tuple(races))
    results = run_match(match, [load_policy(entrant.source, CIRCUIT, CAR)] * 2)
    return results.with_columns(pair=pl.col("race") // 2).partition_by(
        "pair", include_key=False, maintain_order=True
    )


def meet(entrants: Sequence[Entrant], pairs: int) -> NDArray[np.float64]:
    """Point differences of two entrants, 4v4, in so many mirrored pairs."""
    matches = tournament_matches(entrants, pairs, np.random.SeedSequence(SEED))
    results = pl.concat(frame for _, frame in run_matches(matches, 1))
    return differences(appearances(results))["difference"].to_numpy()


def dealt(pair: pl.DataFrame, home: str, away: str, number: int, rng: np.random.Generator) -> pl.DataFrame:
    """A pair of the pool as the `number`th of a matchup, its two sides dealt to the entrants by lot."""
    sides = [home, away] if rng.random() < 0.5 else [away, home]
    return pair.with_columns(
        match=pl.lit(f"{home} v {away}"),
        race=2 * number + pl.col("mirrored").cast(pl.Int64),
        entrant=pl.col("team").replace_strict([0, 1], sides),
    )


def tournament(entrants: int, pool: Pairs, rng: np.random.Generator) -> tuple[pl.DataFrame, float]:
    """RANKING of a tournament of equals drawn from the pool, and the share of its pairs that were raced."""
    names = [f"e{index}" for index in range(entrants)]
    matchups = list(combinations(names, 2))
    rounds = range(0, SETTINGS.pairs, SETTINGS.block)
    results = pl.DataFrame(schema=RESULTS)
    over: set[frozenset[str]] = set()
    raced = 0
    for begin in rounds:
        numbers = range(begin, min(begin + SETTINGS.block, SETTINGS.pairs))
        drawn = [
            dealt(pool[rng.integers(len(pool))], home, away, number, rng)
            for home, away in matchups
            if frozenset((home, away)) not in over
            for number in numbers
        ]
        raced += len(drawn)
        results = pl.concat([results, *drawn])
        over = settled(results, STOPPING, EQUAL)
    ranking = rank(results, rng, confidence=repeated(CONFIDENCE, len(rounds)))
    return ranking, raced / (len(matchups) * SETTINGS.pairs)


def of_equals(entrants: int, tournaments: int, pool: Pairs, console: Console) -> dict[str, float]:
    """Coverage and false differences among so many equal entrants."""
    rng = np.random.default_rng([SEED, entrants])
    truth = sum(TEAM_POINTS) / 2
    covered, false, shares = [], 0, []
    for _ in track(range(tournaments), f"{entrants} equal entrants", console=console):
        ranking, share = tournament(entrants, pool, rng)
        covered += ranking.select(pl.lit(truth).is_between("points_low", "points_high")).to_series().to_list()
        false += bool((ranking["rank"] > 1).any())
        shares.append(share)
    bounds = binomtest(false, tournaments).proportion_ci(CONFIDENCE, "wilson")
    return {
        "coverage": round(float(np.mean(covered)), 4),
        "false_accept": round(false / tournaments, 4),
        "false_accept_low": round(bounds.low, 4),
        "false_accept_high": round(bounds.high, 4),
        "pairs_share": round(float(np.mean(shares)), 3),
    }


def of_champion(difference: NDArray[np.float64]) -> dict[str, float]:
    """How many pairs it takes to tell the champion from the checkpoint before it."""
    rng = np.random.default_rng([SEED, 0])
    fixed = int(np.ceil(((ndtri(1 - STOPPING.alpha / 2) + ndtri(1 - STOPPING.beta)) / STOPPING.effect) ** 2))
    used = [_until_settled(difference, fixed, rng) for _ in range(SHUFFLES)]
    return {
        "t": round(float(difference.mean() / difference.std(ddof=1)), 3),
        "pairs_sequential": round(float(np.mean(used)), 1),
        "pairs_fixed": fixed,
    }


def _until_settled(difference: NDArray[np.float64], cap: int, rng: np.random.Generator) -> int:
    """Pairs, drawn from these, after which the test ends, looking after every block; or the cap."""
    drawn = rng.choice(difference, cap)
    for units in range(SETTINGS.block, cap, SETTINGS.block):
        seen = drawn[:units]
        deviation = max(float(seen.std(ddof=1)), 1e-9)
        t = np.array(abs(float(seen.mean())) / deviation)
        if STOPPING.verdict(np.array(float(units)), t) != OPEN:
            return units
    return cap


def measure(tournaments: int, pool: int, pairs: int, console: Console) -> dict[str, Any]:
    """The figures."""
    entrants = ladder()
    alike = against_itself(entrants[-1], pool)
    return {
        "equal": {size: of_equals(size, tournaments, alike, console) for size in SIZES},
        "champion": of_champion(meet(entrants, pairs)),
        "pool": pool,
        "tournaments": tournaments,
        "effect": STOPPING.effect,
    }


def main() -> None:
    """Measure, show progress on stderr, print the figures as JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.calibration", description="Whether the statistics hold")
    parser.add_argument("--json", type=Path, nargs="?", help="file for the figures as well")
    parser.add_argument("--tournaments", type=int, default=100, help="of equal entrants, for each size")
    parser.add_argument("--pool", type=int, default=100, help="pairs of the champion against itself")
    parser.add_argument("--pairs", type=int, default=24, help="of the champion against the one before it")
    chosen = parser.parse_args()
    figures = measure(chosen.tournaments, chosen.pool, chosen.pairs, Console(stderr=True))
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()

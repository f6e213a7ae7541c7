"""Tournaments drawn from raced mirrored pairs: of equals, and of finalists whose truth many pairs tell."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import polars as pl

from benchmarks.calibration.tally import tally
from benchmarks.meetings import Meeting, Two
from benchmarks.resampled import Units, resampled
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match
from nathlon.arena.statistics import Floats
from nathlon.selection.round_robin import TournamentSettings, run_round_robin
from nathlon.selection.run import Run
from nathlon.tournament.evidence import Evidence
from nathlon.tournament.points import EQUAL


def pool_sd(met: Iterable[Meeting]) -> float:
    """Standard deviation of the pairs' differences about the mean of their two, points a race."""
    return float(np.sqrt(np.mean([meeting.deviation**2 for meeting in met])))


def nearly_equal(met: Sequence[Meeting], effect: float) -> list[Meeting]:
    """Those whose two differ by less than so many standard deviations of pairs."""
    return [meeting for meeting in met if abs(meeting.difference) < effect * meeting.deviation]


def dealt(pairs: pl.DataFrame, names: Sequence[str], rng: np.random.Generator) -> pl.DataFrame:
    """Mirrored pairs, RESULTS of a match, whose two sides go to two names by a coin for each pair.

    Whoever raced them: either name gets either side with the same probability, so that the two are equal.
    """
    pair = pairs["race"].to_numpy() // 2
    side = (pairs["team"].to_numpy() + rng.integers(2, size=pair.max() + 1)[pair]) % 2
    return pairs.with_columns(entrant=pl.Series(np.array(names)[side]))


@dataclass(frozen=True)
class Kind:
    """What tournaments are drawn.

    Attributes:
        field: who takes part in one.
        draw: RESULTS of a match.
        points: what they truly score a race when they meet, in the order of the field.
        pool_sd: standard deviation of the pairs' differences, points a race.
    """

    field: Callable[[np.random.Generator], Sequence[Entrant]]
    draw: Callable[[np.random.Generator, Match], pl.DataFrame]
    points: Callable[[Sequence[Entrant]], Floats]
    pool_sd: float


def of_equals(like: Entrant, met: Sequence[Meeting], entrants: int) -> Kind:
    """Tournaments of so many equals, who drive where another does, from pairs that are dealt by lot."""
    results = pl.concat(meeting.results for meeting in met)
    evidence, units = Evidence(results, EQUAL), Units(results, 2)
    names = [f"equal {number}" for number in range(entrants)]
    field = [replace(like, id=name, name=name) for name in names]

    def draw(rng: np.random.Generator, match: Match) -> pl.DataFrame:
        return dealt(units.drawn(match, rng), match.entrants, rng)

    sd = float(np.sqrt((evidence.met["difference"].to_numpy() ** 2).mean()))
    return Kind(lambda rng: field, draw, lambda field: np.full(len(field), evidence.mean_points), sd)


def of_finalists(finalists: Sequence[Entrant], met: Mapping[Two, Meeting], entrants: int) -> Kind:
    """Tournaments of so many finalists, chosen by lot each time, from the pairs that they raced."""
    units = {two: Units(meeting.results, 2) for two, meeting in met.items()}

    def field(rng: np.random.Generator) -> list[Entrant]:
        return [finalists[number] for number in sorted(rng.choice(len(finalists), entrants, replace=False))]

    def draw(rng: np.random.Generator, match: Match) -> pl.DataFrame:
        return units[frozenset(match.entrants)].drawn(match, rng)

    return Kind(field, draw, lambda field: true_points([one.id for one in field], met), pool_sd(met.values()))


def true_points(entrants: Sequence[str], met: Mapping[Two, Meeting]) -> Floats:
    """Points a race of some entrants (K,) when each meets each equally often: what all raced pairs say."""
    among = [meeting for two, meeting in met.items() if two <= set(entrants)]
    evidence = Evidence(pl.concat(meeting.results for meeting in among), EQUAL)
    points = evidence.solution @ evidence.means + evidence.mean_points
    return points[[evidence.entrants.index(entrant) for entrant in entrants]]


def judged(run: Run, kind: Kind, settings: TournamentSettings, numbers: Iterable[int]) -> dict[str, Any]:
    """Tournaments by their numbers, each run and judged by the stage itself, with its rule of stopping.

    Returns:
        as `tally` does, with `pool_sd`, and `pairs_share`: pairs raced, of their cap.
    """
    rankings, shares = [], []
    known: dict[tuple[Entrant, ...], Floats] = {}
    for number in numbers:
        rng = np.random.default_rng([*run.seeds_from, number])
        field = tuple(kind.field(rng))
        if field not in known:
            known[field] = kind.points(field)
        truth = pl.DataFrame({"entrant": [one.id for one in field], "truth": known[field]})
        drawn = resampled(run, number, partial(kind.draw, rng))
        answer, matches = run_round_robin(drawn, field, settings)
        pairs = sum(len(match.races) // 2 for match in matches)
        shares.append(pairs / (settings.pairs * len(field) * (len(field) - 1) / 2))
        told = answer.tables["ranking"].select("entrant", "rank", low="points_low", high="points_high")
        rankings.append(told.join(truth, on="entrant"))
    return tally(rankings) | {
        "pool_sd": round(kind.pool_sd, 3),
        "pairs_share": round(float(np.mean(shares)), 3),
    }

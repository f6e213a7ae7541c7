"""What a gate has run: the same units of candidate and champion, and which of them are void."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import polars as pl

from nathlon.arena.entrant import Entrant
from nathlon.arena.match import TESTED, Match
from nathlon.arena.voids import NotJudged, is_void, not_judged_by_meetings, not_judged_by_tests, units_met
from nathlon.selection.round_robin import Fixture
from nathlon.selection.run import GATE
from nathlon.selection.trials import against


class RunPair(NamedTuple):
    """A candidate and whose place it would take."""

    candidate: Entrant
    champion: Entrant


class Lost(NamedTuple):
    """Void units of a series.

    Attributes:
        what: the units are.
        units: in all.
        void: that count for nobody.
        doubtful: of these, those that the candidate may have voided: the champion has not voided them alone.
        not_judged: who of the two is not judged, as most of its units are void.
    """

    what: str
    units: int
    void: int
    doubtful: int
    not_judged: list[NotJudged]

    def hides(self, share: float) -> bool:
        """Whether the candidate may have voided more than a share of its units."""
        return self.doubtful > share * self.units

    def hides_for_good(self, share: float, most: int) -> bool:
        """Whether it may have, however few of `most` units are void from now on."""
        return self.doubtful > share * most

    def sentence(self, share: float) -> str:
        """It in words; empty where nothing is void."""
        if not self.void:
            return ""
        told = f"{self.void} of {self.units} {self.what} are void"
        if self.not_judged:
            return f"{told}, so this is not judged"
        if self.hides(share):
            return f"{told}, {self.doubtful} maybe by its doing: above {100 * share:g} % it cannot pass"
        return f"{told} and count for nobody"


@dataclass(frozen=True)
class Series:
    """Matches whose results answer some questions; the same ones never run twice.

    Attributes:
        most: units or runs in all.
        matches: those of some of the units.
        lost: of the RESULTS so far.
    """

    most: int
    matches: Callable[[slice], list[Match]]
    lost: Callable[[pl.DataFrame], Lost]


def race_series(fixtures: Sequence[Fixture], most: int) -> Series:
    """Mirrored races of the two against each other."""
    return Series(
        most,
        lambda units: [made.match(units, GATE) for made in fixtures if made.meeting.seeds[units]],
        _lost_races,
    )


def trial_series(
    scenario: str,
    pair: RunPair,
    opponents: Sequence[str],
    slots: Sequence[int],
    seeds: Sequence[int],
    in_order: bool = False,
) -> Series:
    """The same runs of both, one after the other, each among the same opponents."""

    def matches(units: slice) -> list[Match]:
        begin = units.start % len(slots)
        turned = [*slots[begin:], *slots[:begin]]
        return [
            against(GATE, scenario, scenario, entrant, opponents, turned, seeds[units], in_order)
            for entrant in (pair.candidate, pair.champion)
        ]

    return Series(len(seeds), matches, lambda results: _lost_trials(results, pair))


def _lost_races(results: pl.DataFrame) -> Lost:
    """Nobody knows which of the two has voided what they raced together."""
    units = units_met(results).group_by("match", "run").agg(pl.col("void").any())
    void = int(units["void"].sum())
    return Lost("pairs", units.height, void, void, not_judged_by_meetings(results))


def _lost_trials(results: pl.DataFrame, pair: RunPair) -> Lost:
    tested = results.with_columns(void=is_void()).filter(pl.col("team") == TESTED)
    ours, theirs = (
        tested.filter(pl.col("entrant") == one.id).group_by("seed").agg(pl.col("void").any()) for one in pair
    )
    both = ours.join(theirs, on="seed", suffix="_theirs")
    mine, other = both["void"], both["void_theirs"]
    return Lost(
        "runs",
        both.height,
        int((mine | other).sum()),
        int((mine & ~other).sum()),
        not_judged_by_tests(results),
    )

"""What a simulator offers so that its policies can be selected among: one row a seat an episode comes of it.

Everything above the arena works on these rows (`nathlon.arena.results.RESULTS`) and knows no simulator.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol, runtime_checkable

import polars as pl
from gymnasium import spaces

if TYPE_CHECKING:
    from nathlon.arena.entrant import Entrant
    from nathlon.arena.match import Match
    from nathlon.arena.team import Absent
    from nathlon.arena.watch import Watch

Points = Literal["place", "score"]
Space = spaces.Space[Any]
Loader = Callable[[Path, Space, Space], Any]
"""Makes a policy of a file, for a space of observations and one of actions.

What it gives is called with one observation, and answers with an action. Or it has
`act(observation, memory)`, which answers with an action and the memory for the next step; the first is None.
If it has `reset(seed)`, that is called before every episode. A module of torch is called with a batch of one.
"""


class WorldError(Exception):
    """An episode cannot be gone by: a sentence that says why, and names the seat where it is one's."""


class Measure(NamedTuple):
    """What a number of a row means.

    Attributes:
        unit: SI where there is one; "1" for shares and counts.
        goal: whether less or more is better.
    """

    unit: str
    goal: Literal["min", "max"]


KNOWN: Mapping[str, Measure] = {
    "score": Measure("1", "max"),
    "laps": Measure("1", "max"),
    "race_time_s": Measure("s", "min"),
    "driven_s": Measure("s", "max"),
    "distance_m": Measure("m", "max"),
    "best_lap_s": Measure("s", "min"),
    "off_course_s": Measure("s", "min"),
    "wall_s": Measure("s", "min"),
    "contacts": Measure("1", "min"),
    "contacts_at_fault": Measure("1", "min"),
    "penalties": Measure("1", "min"),
}
"""Measures that stages know by name: columns of RESULTS. A world may declare others of its own."""


@dataclass(frozen=True)
class Setup:
    """A scenario as those see it who plan matches.

    Attributes:
        seats: names of the seats, in the order of a row's `car`.
        sides: indices of the seats of each side that entrants take; whoever enters for a side takes all its
            seats. The baseline takes the seats of no side.
        points: whether a row's points are those of its place (10 8 6 5 4 3 2 1, equal ones share) or its
            score.
        time_s: of an episode, at most; by it matches that run together are made equally long.
        ends: whether it has an end of its own, before the time is up.
        roles: of each seat, where an entrant has a policy for each role; '' of a seat of no side. Empty where
            one policy takes all seats.
    """

    seats: tuple[str, ...]
    sides: tuple[tuple[int, ...], ...]
    points: Points = "score"
    time_s: float = 60.0
    ends: bool = True
    roles: tuple[str, ...] = ()

    @property
    def free(self) -> set[int]:
        """The seats of no side, which are the baseline's."""
        return set(range(len(self.seats))) - {seat for side in self.sides for seat in side}


@dataclass(frozen=True)
class Outcome:
    """How an episode went for a seat.

    Attributes:
        score: more is better; None where places alone count.
        place: 1 is best, equal places are ties; None where it follows from the scores.
        finished: whether the episode came to its own end, and not to its time limit.
        measures: known ones (`KNOWN`) and the world's own, by name.
    """

    score: float | None = None
    place: int | None = None
    finished: bool = True
    measures: Mapping[str, float] = field(default_factory=dict)


class Player(Protocol):
    """Who takes a seat in an episode."""

    def act(self, observation: Any, mask: Any = None) -> Any:
        """What it does, of the seat's action space, having seen an observation of its observation space.

        A mask says which choices are allowed; an observation with `action_mask` brings its own.

        A policy that fails is replaced by one that idles, so that the others can play on.
        """
        ...


LineUp = tuple["Match", Sequence["Any | Absent"]]
"""A match and a policy for each of its entrants."""


class World(Protocol):
    """A simulator.

    Attributes:
        name: by which it was loaded, see `nathlon.arena.world_finding`.
        scenarios: names of what can be played; the first is what everybody plays in the filter.
        measures: its own, by name; a name of `KNOWN` has its unit there.
        baseline: source of the policy that takes the seats of no side, and sets the marks of tests.
        episode: what its users call one, for reports: a race, a game; "episode" where it does not say.
        circuits: whether it is played on circuits with cars, which its matches and entrants then name; not
            where it does not say.
        loaders: of files of policies that its own code reads, by the endings of their names.
    """

    name: str
    scenarios: tuple[str, ...]
    measures: Mapping[str, Measure]
    baseline: str
    episode: str
    circuits: bool
    loaders: Mapping[str, Loader]

    def setup(self, scenario: str) -> Setup:
        """A scenario.

        Raises:
            InputError: if there is none of this name.
        """
        ...

    def check(self, scenario: str) -> None:
        """See whether a scenario can be played here.

        Raises:
            InputError: if it cannot.
        """
        ...

    def facts(self, scenario: str) -> dict[str, Any]:
        """All that decides how a match of a scenario ends, as plain JSON values."""
        ...

    def enter(self, source: str) -> Entrant:
        """The entrant that a user calls by a path or a name.

        Raises:
            InputError: if it cannot play here.
        """
        ...

    def policy(self, source: str) -> Any:
        """The policy of a source, for `run`.

        Raises:
            InputError: if it cannot be loaded.
        """
        ...

    def run(self, line_ups: Mapping[int, LineUp], watch: Watch) -> Iterator[tuple[int, pl.DataFrame]]:
        """Play matches of one scenario.

        Args:
            line_ups: what to play, by numbers of the caller's.
            watch: told who is asked, with the number of the match.

        Yields:
            the number of a match and its RESULTS, one row a seat an episode, as soon as it is over.
        """
        ...


class Onlooker(Protocol):
    """Who looks on while an episode is played."""

    def __call__(self, time_s: float, draw: Callable[[], Any], last: bool) -> None:
        """Be told of a moment.

        Args:
            time_s: since the start of the episode, s.
            draw: gives a picture of it, (height, width, 3) uint8; it need not be called.
            last: whether the episode ends with this moment.
        """
        ...


@runtime_checkable
class Visible(Protocol):
    """What a world may offer besides: episodes that can be looked at."""

    def shows(self, scenario: str) -> bool:
        """Whether there are pictures of a scenario's episodes."""
        ...

    def replay(self, line_up: LineUp, race: int, watch: Watch, onlooker: Onlooker) -> pl.DataFrame:
        """Play an episode of a match again, with somebody looking on.

        Returns:
            its RESULTS, as of `World.run`.
        """
        ...

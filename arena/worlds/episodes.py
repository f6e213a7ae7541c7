"""A world that plays one episode at a time, and the rows that come of it."""

from __future__ import annotations

import json
import logging
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from nathlon.arena.classification import PLACE_POINTS
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match
from nathlon.arena.naming import stem
from nathlon.arena.results import POLICY_FAULTS, RESULTS
from nathlon.arena.rounding import levelled
from nathlon.arena.watch import Watch
from nathlon.arena.world import (
    KNOWN,
    LineUp,
    Loader,
    Measure,
    Onlooker,
    Outcome,
    Player,
    Setup,
    Space,
    WorldError,
)
from nathlon.arena.worlds.loaded import LoadedPolicy, loader_of
from nathlon.arena.worlds.player import Asking
from nathlon.policies.general import load_general
from nathlon.policies.general.policy import GeneralPolicy
from nathlon.policies.general.roles import RolePolicies, Spaces
from nathlon.policies.isolation import Apart
from nathlon.policies.patience import WORLD_ANSWER_S, WORLD_OPENS_S
from nathlon.policies.sources import PLUGIN, ROLES, is_path
from nathlon.policies.sources.zoo_settings import alike
from nathlon.sim.decisive import EPISODES, fingerprint
from nathlon.sim.errors import InputError

log = logging.getLogger(__name__)
MOST, MOST_COUNTED = 1e100, 2**53
"""Sizes of numbers of an outcome, at most: sums of squares are to be finite, and counts exact."""


class EpisodeWorld(ABC):
    """A world of episodes; whoever derives from it says what is played and plays it.

    Attributes:
        name: by which it is loaded, see `nathlon.arena.world_registry`.
        scenarios, measures, baseline, episode, circuits: as of `nathlon.arena.world.World`.
        file: of the module that it is found in; None where there is none.
        loaders: of files of policies, by the endings of their names.
        fault: why the last episode that was void was so; '' while none was.
        answer_s: what a step may take; where one takes longer, the world hangs, and the match is void.
    """

    name: str = ""
    scenarios: tuple[str, ...]
    measures: Mapping[str, Measure] = {}
    baseline: str = "random"
    episode: str = "episode"
    circuits: bool = False
    file: Path | None = None
    loaders: Mapping[str, Loader] = {}
    fault: str = ""
    answer_s: float = WORLD_ANSWER_S

    @abstractmethod
    def setup(self, scenario: str) -> Setup:
        """As of `nathlon.arena.world.World`."""

    def check(self, scenario: str) -> None:
        """As of `nathlon.arena.world.World`."""
        self.setup(scenario)

    @abstractmethod
    def spaces(self, scenario: str) -> Sequence[tuple[Space, Space]]:
        """Spaces of observations and actions of every seat."""

    def wrappers(self, scenario: str) -> set[str]:
        """Names of the classes that an environment is wrapped in, where it is one."""
        return set()

    def made_with(self, scenario: str) -> Mapping[str, Any] | None:
        """Arguments that `gymnasium.make` made an environment with; None where that is not known."""
        return None

    @abstractmethod
    def identity(self) -> dict[str, Any]:
        """All that decides how its episodes go, as plain JSON values."""

    @abstractmethod
    def play(self, scenario: str, players: Sequence[Player], seed: int) -> Sequence[Outcome]:
        """Play an episode: what came of it for every seat. All randomness comes from the seed."""

    def shows(self, scenario: str) -> bool:
        """As of `nathlon.arena.world.Visible`: not, unless `show` hands pictures on."""
        return False

    def show(
        self, scenario: str, players: Sequence[Player], seed: int, onlooker: Onlooker
    ) -> Sequence[Outcome]:
        """Play an episode as `play` does, and tell an onlooker of every moment; for worlds with pictures."""
        return self.play(scenario, players, seed)

    def facts(self, scenario: str) -> dict[str, Any]:
        """As of `nathlon.arena.world.World`."""
        return {"code": fingerprint(names=EPISODES), "world_files": self.identity()}

    def enter(self, source: str) -> Entrant:
        """As of `nathlon.arena.world.World`."""
        policy = self.policy(source)
        algorithm = policy.algorithm or "unknown"
        name = stem(source).removeprefix(f"{PLUGIN}:")
        return Entrant(policy.id, name, source, algorithm, "", "", policy.step, policy.seed, self.name)

    def policy(self, source: str) -> GeneralPolicy | LoadedPolicy | RolePolicies:
        """As of `nathlon.arena.world.World`.

        Raises:
            InputError: if it cannot be loaded, or does not fit a seat that entrants take.
        """
        seats = self._seats()
        if source.endswith(ROLES):
            return RolePolicies.load(source, seats if "" not in seats else {}, self._opened)
        all_spaces = [spaces for role in seats.values() for spaces in role]
        try:
            return self._opened(source, all_spaces)
        except InputError as error:
            hint = "" if "" in seats else f"; or a file NAME{ROLES} with a policy for each role"
            raise InputError(f"{error}{hint}") from None

    def _opened(self, source: str, seats: Sequence[Spaces]) -> GeneralPolicy | LoadedPolicy:
        """The policy of a source for seats of these spaces.

        Raises:
            InputError: if it cannot be loaded, or does not fit one of them.
        """
        load = loader_of(self.loaders, source) if is_path(source) else None
        read = load_general(source, *seats[0]) if load is None else LoadedPolicy.read(source, load, *seats[0])
        for spaces in seats[1:]:
            read.check(*spaces)
        if isinstance(read, GeneralPolicy):
            self._check_training(read)
        return read

    def _check_training(self, policy: GeneralPolicy) -> None:
        """Raise an InputError if the environment is not made as in training, or in another wrapper."""
        told = (self.made_with(self.scenarios[0]) if policy.made_with else None) or {}
        for name, value in policy.made_with.items():
            if name not in told or not alike(told[name], value):
                raise InputError(
                    f"{policy.source}: was trained in an environment made with {name}={value!r}, "
                    "expected it made so in the mapping's function, by gymnasium.make"
                )
        for name in policy.wrappers:
            if name not in self.wrappers(self.scenarios[0]):
                raise InputError(
                    f"{policy.source}: was trained in the wrapper {name}, expected the environment in it: "
                    "wrap it in the mapping's function"
                )

    def _seats(self) -> dict[str, tuple[Spaces, ...]]:
        """Spaces of the seats that entrants take in the first scenario, by role; all by '' without roles."""
        scenario = self.scenarios[0]
        setup, all_spaces = self.setup(scenario), self.spaces(scenario)
        seats: dict[str, tuple[Spaces, ...]] = {}
        for seat in (seat for side in setup.sides for seat in side):
            role = setup.roles[seat] if setup.roles else ""
            seats[role] = (*seats.get(role, ()), all_spaces[seat])
        return seats

    def run(self, line_ups: Mapping[int, LineUp], watch: Watch) -> Iterator[tuple[int, pl.DataFrame]]:
        """As of `nathlon.arena.world.World`: one episode after another."""
        for number, (match, policies) in line_ups.items():
            rows = [
                row
                for index in range(len(match.races))
                for row in self.rows(match, index, policies, watch, number)
            ]
            yield number, pl.DataFrame(rows, schema=RESULTS)

    def replay(self, line_up: LineUp, race: int, watch: Watch, onlooker: Onlooker) -> pl.DataFrame:
        """As of `nathlon.arena.world.Visible`."""
        match, policies = line_up
        rows = self.rows(match, race, policies, watch, 0, onlooker)
        return pl.DataFrame(rows, schema=RESULTS)

    def rows(
        self,
        match: Match,
        index: int,
        policies: Sequence[Any],
        watch: Watch,
        number: int,
        onlooker: Onlooker | None = None,
    ) -> list[dict[str, Any]]:
        """Play a race of a match by itself: its rows of RESULTS."""
        seed, players = match.races[index].seed, self.seated(match, index, policies, watch, number)
        watch.work(self.patience_s)
        try:
            # Environments older than generators that are passed in draw from those of the process.
            with Apart(seed % 2**32).entered():
                if onlooker is None:
                    outcomes = list(self.play(match.scenario, players, seed))
                else:
                    outcomes = list(self.show(match.scenario, players, seed, onlooker))
            return self.told(match, index, players, outcomes)
        except MemoryError:
            raise
        # It is foreign code: whatever goes wrong in it, only this episode is void.
        except (Exception, SystemExit) as error:
            plain = isinstance(error, WorldError | InputError)
            said = str(error) if plain else f"{type(error).__name__} ({error})"
            self.fault = f"world {self.name!r}, scenario {match.scenario!r}: {said}"
            log.warning("%s: the episode is void", self.fault)
            return self._results(match, index, [Outcome()] * len(players), ["simulator_fault"] * len(players))

    @property
    def patience_s(self) -> float:
        """What it may take until it asks the first policy of an episode."""
        return max(WORLD_OPENS_S, self.answer_s)

    def seated(
        self, match: Match, index: int, policies: Sequence[Any], watch: Watch, number: int
    ) -> list[Asking]:
        """Who takes the seats in a race of a match."""
        race, setup = match.races[index], self.setup(match.scenario)
        rngs = np.random.default_rng(race.seed).spawn(len(race.seats))
        roles = setup.roles or [""] * len(setup.seats)
        taken: Counter[int] = Counter()
        players = []
        for seat, name, role, spaces, rng in zip(
            race.seats, setup.seats, roles, self.spaces(match.scenario), rngs, strict=True
        ):
            policy, seed = _in_role(policies[seat.entrant], role), race.seed % 2**32
            asking = Asking(policy, name, *spaces, rng, seed, self.answer_s, taken[id(policy)])
            players.append(asking.watched(watch, number, seat.entrant))
            taken[id(policy)] += 1
        return players

    def told(
        self, match: Match, index: int, players: Sequence[Asking], outcomes: Sequence[Outcome]
    ) -> list[dict[str, Any]]:
        """The rows of RESULTS of a race of a match.

        Raises:
            WorldError: if the episode cannot be gone by.
        """
        self._check(self.setup(match.scenario), outcomes)
        endings = [
            player.fault or ("finished" if outcome.finished else "time_up")
            for player, outcome in zip(players, outcomes, strict=True)
        ]
        return self._results(match, index, outcomes, endings)

    def _results(
        self, match: Match, index: int, outcomes: Sequence[Outcome], endings: Sequence[str]
    ) -> list[dict[str, Any]]:
        faulty = [ending in POLICY_FAULTS for ending in endings]
        places = placed(outcomes, faulty)
        by_place = self.setup(match.scenario).points == "place"
        points = place_points(places) if by_place else score_points(outcomes, faulty)
        return [
            {
                **dict.fromkeys(RESULTS.names()),
                **_known(outcome),
                **match.seat_facts(index, car),
                "place": places[car],
                "points": points[car],
                "ending": endings[car],
                "score": outcome.score,
                "measures": self._own(outcome),
            }
            for car, outcome in enumerate(outcomes)
        ]

    def _check(self, setup: Setup, outcomes: Sequence[Outcome]) -> None:
        if len(outcomes) != len(setup.seats):
            raise WorldError(f"gives {len(outcomes)} outcomes, expected {len(setup.seats)}, one a seat")
        for seat, outcome in zip(setup.seats, outcomes, strict=True):
            if outcome.score is None and outcome.place is None:
                raise WorldError(f"seat {seat!r}: neither a score nor a place")
            numbers = {"score": outcome.score, **outcome.measures}
            for name, value in numbers.items():
                if value is not None and not np.isfinite(value):
                    raise WorldError(f"seat {seat!r}: {name} is {value}, expected a finite number")
                most = MOST_COUNTED if RESULTS.get(name) == pl.Int64 else MOST
                if value is not None and abs(value) > most:
                    raise WorldError(f"seat {seat!r}: {name} is {value}, expected {most:g} at most in size")
            for name in outcome.measures:
                if name not in KNOWN and name not in self.measures:
                    raise WorldError(f"seat {seat!r}: measure {name!r} is not one that the world declares")

    def _own(self, outcome: Outcome) -> str | None:
        own = {name: float(v) for name, v in sorted(outcome.measures.items()) if name not in KNOWN}
        return json.dumps(own) if own else None


def _in_role(policy: Any, role: str) -> Any:
    """Who plays for an entrant in a seat; the one policy, if it has no others."""
    return policy.by_role[role] if isinstance(policy, RolePolicies) else policy


def _known(outcome: Outcome) -> dict[str, float | int]:
    """The known measures of an outcome, as the columns of RESULTS have them."""
    return {
        name: int(value) if RESULTS[name] == pl.Int64 else float(value)
        for name, value in outcome.measures.items()
        if name in KNOWN and name != "score"
    }


def placed(outcomes: Sequence[Outcome], faulty: Sequence[bool]) -> list[int]:
    """Places, equal ones sharing the best; those whose policy has failed come last, all alike."""
    scores = levelled(np.array([outcome.score or 0.0 for outcome in outcomes]))
    order = [
        (True, 0.0) if fault else (False, outcome.place if outcome.place is not None else -float(score))
        for outcome, score, fault in zip(outcomes, scores, faulty, strict=True)
    ]
    return [1 + sum(other < own for other in order) for own in order]


def place_points(places: Sequence[int]) -> list[float]:
    """Points of places; those who share a place share the points of the places that they take up."""
    ladder = [*PLACE_POINTS, *[0.0] * len(places)]
    return [
        sum(ladder[place - 1 : place - 1 + places.count(place)]) / places.count(place) for place in places
    ]


def score_points(outcomes: Sequence[Outcome], faulty: Sequence[bool]) -> list[float]:
    """Scores as points; whoever's policy has failed has fewer than all whom it was ahead of.

    It is behind the last who has finished by as much as it was ahead: a lead before a failure counts against
    it, as scores have no unit in which a failure could cost something. Where all have failed, all are equal.
    """
    scores = [outcome.score or 0.0 for outcome in outcomes]
    whole = [score for score, fault in zip(scores, faulty, strict=True) if not fault]
    if not whole:
        return [min(scores)] * len(scores)
    last = min(whole)
    return [last - abs(score - last) if fault else score for score, fault in zip(scores, faulty, strict=True)]

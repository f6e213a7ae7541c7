"""Races side by side in which opponents drive some of the cars, and others are driven from outside."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.apart import load_guest
from nathlon.policies.driver.shown_plan import show_plan, show_plans
from nathlon.policies.planning import decide
from nathlon.policies.policy import Batch, Policy, has_reverse, trained_with_reverse
from nathlon.sim.episode import Episodes, Moment, View
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.world import World

Indices = NDArray[np.int64]


class SeatedOpponent:
    """A policy that may drive any of the opponents' cars, with a memory for each of them.

    Attributes:
        reverse: whether its cars have a reverse gear.
    """

    def __init__(self, policy: Policy, view: View, world: World, races: Indices, cars: Indices) -> None:
        """A policy, the view from all of those cars, the world, and (n,) their indices in it."""
        self._policy, self._view, self._world = policy, view, world
        self._races, self._cars = races, cars
        self._memory = policy.initial_memory(len(cars))
        self.reverse = has_reverse(policy)

    def act(self, cars: Indices) -> Batch:
        """Actions of some of the cars, (n, 2)."""
        where = self._races[cars], self._cars[cars]
        actions, self._memory[cars] = decide(
            self._policy, self._world, *where, self._view.seen[cars], self._memory[cars]
        )
        return actions

    def forget(self, cars: Indices) -> None:
        """Start the memory of some of the cars afresh."""
        self._memory[cars] = self._policy.initial_memory(len(cars))


class OpponentWrapper:
    """Episodes in which opponents act for some of the cars, as a Gymnasium wrapper changes an environment.

    Attributes:
        episodes: the races themselves, read them freely.
        races, cars: (n,) indices of the cars that are driven from outside.
        others: how many cars of each race the opponents drive.
    """

    def __init__(
        self,
        episodes: Episodes,
        places: Sequence[int],
        observation: ObservationSpec,
        opponents: Sequence[Policy],
    ) -> None:
        """Races yet to be started.

        Args:
            episodes: the races.
            places: indices of the cars that are driven from outside, the same in every race.
            observation: what is seen from those.
            opponents: who drive the others in turn, beginning one further on in each race, until
                `seat` says otherwise.

        Raises:
            InputError: if nobody drives the others.
        """
        self.episodes = episodes
        races, count = episodes.world.state.shape
        others = np.setdiff1d(np.arange(count), places)
        self.others = len(others)
        if self.others and not opponents:
            raise InputError(
                f"opponents is empty, expected someone for {self.others} of the {count} cars "
                f"of scenario {episodes.scenario.name!r}"
            )
        self.races, self.cars = _seats(np.arange(races), np.sort(places))
        if observation.planned:
            show_plan(episodes.world)
        self._view = episodes.watch(observation, self.races, self.cars)
        self._reverse = trained_with_reverse(observation)
        self._other_races, self._other_cars = _seats(np.arange(races), others)
        self._views: dict[ObservationSpec, View] = {}
        self._opponents: list[SeatedOpponent] = []
        self._shares: list[Indices] = []
        if self.others:
            self._opponents = [self._engage(policy) for policy in opponents]
            self._who = np.add.outer(np.arange(races), np.arange(self.others)) % len(opponents)
            self._share_out()

    def _engage(self, policy: Policy) -> SeatedOpponent:
        spec = policy.observation_spec
        if spec not in self._views:
            show_plans(self.episodes.world, policy)
            self._views[spec] = self.episodes.watch(spec, self._other_races, self._other_cars)
        return SeatedOpponent(
            policy, self._views[spec], self.episodes.world, self._other_races, self._other_cars
        )

    def _share_out(self) -> None:
        self._shares = [np.flatnonzero(self._who == turn) for turn in range(len(self._opponents))]

    @property
    def seen(self) -> NDArray[Any]:
        """What is seen from the cars that are driven from outside, (n, ...) as of `World.observe`."""
        return self._view.seen

    def seat(self, races: Sequence[int] | Indices, who: Indices) -> None:
        """Have other opponents drive in some races.

        Args:
            races: those that are started next.
            who: (races, others) index of the opponent on each place.
        """
        self._who[races] = who
        self._share_out()

    def seated(self, races: Sequence[int]) -> Indices:
        """Who drives in some races, (races, others) indices of opponents."""
        return self._who[races].copy()

    def replace(self, index: int, policy: Policy) -> None:
        """Have another policy drive the cars of an opponent from here on."""
        known = len(self._views)
        self._opponents[index] = self._engage(policy)
        self._fit_gears()
        if len(self._views) > known:
            self._views[policy.observation_spec].look(self.episodes.world)

    def start(
        self,
        races: Sequence[int],
        rngs: Iterable[np.random.Generator],
        moments: Mapping[int, Moment] | None = None,
    ) -> None:
        """Start some races anew; for the arguments see `Episodes.start`."""
        cars = np.flatnonzero(np.isin(self._other_races, races))
        for opponent in self._opponents:
            opponent.forget(cars)
        self.episodes.start(races, rngs, moments)
        self._fit_gears()

    def _fit_gears(self) -> None:
        """Give a reverse gear to the cars of those who know one."""
        fitted = self.episodes.world.state["has_reverse"]
        fitted[self.races, self.cars] = self._reverse
        for opponent, share in zip(self._opponents, self._shares, strict=True):
            fitted[self._other_races[share], self._other_cars[share]] = opponent.reverse

    def step(self, actions: NDArray[np.float32]) -> NDArray[np.float64]:
        """Advance all races by one step.

        Args:
            actions: (n, 2), those of cars that no longer drive are ignored.

        Returns:
            (n,) reward; see `Episodes.step`.

        Raises:
            ValueError: if an action is not finite.
        """
        everybody = np.zeros((*self.episodes.endings.shape, 2), np.float32)
        everybody[self.races, self.cars] = actions
        for turn, opponent in enumerate(self._opponents):
            share = self._shares[turn]
            if len(share):
                everybody[self._other_races[share], self._other_cars[share]] = opponent.act(share)
        return self.episodes.step(everybody)[self.races, self.cars]


def _seats(races: Indices, cars: Indices) -> tuple[Indices, Indices]:
    """Indices of all pairs of races and cars, race by race, each (n,)."""
    return np.repeat(races, len(cars)), np.tile(cars, len(races))


def load_opponents(opponents: Sequence[str | Policy], circuit: str, car: str) -> list[Policy]:
    """Policies, of which some are given by name; see `nathlon.policies.apart.load_guest`.

    Raises:
        InputError: if a name is not that of a policy.
    """
    return [
        load_guest(opponent, circuit, car) if isinstance(opponent, str) else opponent
        for opponent in opponents
    ]


def single_seat(
    episodes: Episodes,
    place: int | None,
    observation: ObservationSpec,
    opponents: Sequence[Policy],
) -> OpponentWrapper:
    """Episodes in which one car of each race is driven from outside.

    Args:
        episodes: the races.
        place: its starting place, 1 is the first; None for the last.
        observation, opponents: as of `OpponentWrapper`.

    Raises:
        InputError: if there is no such place, or nobody drives the others.
    """
    cars = episodes.scenario.cars
    if place is None:
        place = cars
    if not 1 <= place <= cars:
        raise InputError(f"place is {place}, expected 1 to {cars} in scenario {episodes.scenario.name!r}")
    return OpponentWrapper(episodes, [place - 1], observation, opponents)

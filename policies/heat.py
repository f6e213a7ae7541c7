"""Heats: races side by side in which policies drive some of the cars, and others are driven from outside."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from policies.load import load_policy
from policies.policy import Batch, Policy
from sim.episode import Episodes, View
from sim.errors import InputError
from sim.observation import ObservationSpec

Indices = NDArray[np.int64]


class Opponent:
    """A policy and the cars that it drives."""

    def __init__(self, policy: Policy, episodes: Episodes, races: Indices, cars: Indices) -> None:
        """Cars at (n,) indices."""
        self.races, self.cars = races, cars
        self._policy = policy
        self._view: View = episodes.watch(policy.observation_spec, races, cars)
        self._memory = policy.initial_memory(len(races))

    def act(self) -> Batch:
        """Actions of its cars, (n, 2)."""
        actions, self._memory = self._policy.act(self._view.seen, self._memory)
        return actions

    def forget(self, races: Iterable[int]) -> None:
        """Start the memory of its cars in some races afresh."""
        mine = np.isin(self.races, list(races))
        self._memory[mine] = self._policy.initial_memory(int(mine.sum()))


class Heat:
    """Races of one scenario, side by side.

    Attributes:
        episodes: the races themselves, read them freely.
        races, cars: (n,) indices of the cars that are driven from outside.
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
            opponents: who drive the others in turn, beginning one further on in each race.

        Raises:
            InputError: if nobody drives the others.
        """
        self.episodes = episodes
        races, count = episodes.world.state.shape
        others = np.setdiff1d(np.arange(count), places)
        if len(others) and not opponents:
            raise InputError(
                f"opponents is empty, expected someone for {len(others)} of the {count} cars "
                f"of scenario {episodes.scenario.name!r}"
            )
        self.races, self.cars = _seats(np.arange(races), np.sort(places))
        self._view = episodes.watch(observation, self.races, self.cars)
        other_races, other_cars = _seats(np.arange(races), others)
        turns = other_races + np.searchsorted(others, other_cars)
        self._opponents = [
            Opponent(policy, episodes, other_races[mine], other_cars[mine])
            for turn, policy in enumerate(opponents)
            if (mine := turns % len(opponents) == turn).any()
        ]

    @property
    def seen(self) -> NDArray[np.float32]:
        """What is seen from the cars that are driven from outside, (n, size) float32."""
        return self._view.seen

    def start(self, races: Sequence[int], rngs: Iterable[np.random.Generator]) -> None:
        """Start some races anew, each with a generator of its own."""
        for opponent in self._opponents:
            opponent.forget(races)
        self.episodes.start(races, rngs)

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
        for opponent in self._opponents:
            everybody[opponent.races, opponent.cars] = opponent.act()
        return self.episodes.step(everybody)[self.races, self.cars]


def _seats(races: Indices, cars: Indices) -> tuple[Indices, Indices]:
    """Indices of all pairs of races and cars, race by race, each (n,)."""
    return np.repeat(races, len(cars)), np.tile(cars, len(races))


def load_opponents(opponents: Sequence[str | Policy], circuit: str, car: str) -> list[Policy]:
    """Policies, of which some are given by name; see `policies.load.load_policy`.

    Raises:
        InputError: if a name is not that of a policy.
    """
    return [
        load_policy(opponent, circuit, car) if isinstance(opponent, str) else opponent
        for opponent in opponents
    ]


def single_seat(
    episodes: Episodes,
    place: int | None,
    observation: ObservationSpec,
    opponents: Sequence[Policy],
) -> Heat:
    """A heat in which one car of each race is driven from outside.

    Args:
        episodes: the races.
        place: its starting place, 1 is the first; None for the last.
        observation, opponents: as of `Heat`.

    Raises:
        InputError: if there is no such place, or nobody drives the others.
    """
    cars = episodes.scenario.cars
    if place is None:
        place = cars
    if not 1 <= place <= cars:
        raise InputError(f"place is {place}, expected 1 to {cars} in scenario {episodes.scenario.name!r}")
    return Heat(episodes, [place - 1], observation, opponents)

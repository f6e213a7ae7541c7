"""Worlds whose simulator steps many episodes at once: matches that run together share its batches."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.results import RESULTS
from nathlon.arena.watch import Watch
from nathlon.arena.world import LineUp, Onlooker, Outcome, Player, Space, WorldError
from nathlon.arena.worlds.environment import SEEDS, PettingZooWorld, during
from nathlon.arena.worlds.host import ONLY
from nathlon.arena.worlds.player import idle
from nathlon.arena.worlds.seat_record import SeatRecord
from nathlon.policies.isolation import Apart

log = logging.getLogger(__name__)

BatchFactory = Callable[[int], Any]
"""Makes an environment of so many episodes."""


class VectorWorld(PettingZooWorld):
    """Scenarios that are batches of episodes: a `VectorEnv` of Gymnasium, or a `ParallelEnv` of such arrays.

    A batch always has the same size, so that an episode goes as it goes alone; what is left over is idle.
    `reset(seed=[...])` gets a seed for each episode. Whether an episode is begun anew after its end is the
    environment's business: nobody looks any more.
    """

    def __init__(self, scenarios: Mapping[str, BatchFactory], *, size: int = 64, **settings: Any) -> None:
        """A world of batches.

        Args:
            scenarios: functions that make the environment of each for a number of episodes, by name.
            size: how many episodes a batch has.
            settings: as of `PettingZooWorld`, without `python`.

        Raises:
            ValueError: if a scenario is no function, or a batch has no episode.
        """
        if size < 1:
            raise ValueError(f"size is {size}, expected 1 or more")
        super().__init__(scenarios, **settings)
        self._size = size

    def made(self, scenario: str) -> Any:
        """A new environment of a scenario, as a `ParallelEnv` of arrays."""
        environment = self.make(scenario, self._size)
        return environment if hasattr(environment, "possible_agents") else _OneSeat(environment)

    def shows(self, scenario: str) -> bool:
        """Nobody can look at one episode of a batch."""
        return False

    def run(self, line_ups: Mapping[int, LineUp], watch: Watch) -> Iterator[tuple[int, pl.DataFrame]]:
        """As of `nathlon.arena.world.World`: all matches batch by batch."""
        rows: dict[int, list[dict[str, Any]]] = {number: [] for number in line_ups}
        left = {number: len(match.races) for number, (match, _) in line_ups.items()}
        waiting = [(number, race) for number in line_ups for race in range(left[number])]
        for begin in range(0, len(waiting), self._size):
            for number, race_rows in self._batch(waiting[begin : begin + self._size], line_ups, watch):
                rows[number] += race_rows
                left[number] -= 1
                if not left[number]:
                    yield number, pl.DataFrame(rows.pop(number), schema=RESULTS)

    def _batch(
        self, places: Sequence[tuple[int, int]], line_ups: Mapping[int, LineUp], watch: Watch
    ) -> Iterator[tuple[int, list[dict[str, Any]]]]:
        """The rows of some races of matches that are played together."""
        matches = [line_ups[number][0] for number, _ in places]
        seated = [
            self.seated(match, race, line_ups[number][1], watch, number)
            for match, (number, race) in zip(matches, places, strict=True)
        ]
        seeds = [match.races[race].seed for match, (_, race) in zip(matches, places, strict=True)]
        watch.work(self.patience_s)
        try:
            with Apart(seeds[0] % 2**32).entered():
                outcomes = self._together(matches[0].scenario, seated, seeds)
            ended = zip(places, matches, seated, outcomes, strict=True)
            told = [self.told(match, race, players, one) for (_, race), match, players, one in ended]
        except MemoryError:
            raise
        # Each by itself, for only that is void in which something goes wrong.
        except (Exception, SystemExit) as error:
            log.warning("world %r: a batch broke off (%s): its episodes are played alone", self.name, error)
            for number, race in places:
                match, policies = line_ups[number]
                yield number, self.rows(match, race, policies, watch, number)
            return
        for (number, _), race_rows in zip(places, told, strict=True):
            yield number, race_rows

    def show(self, scenario: str, players: Sequence[Player], seed: int, onlooker: Onlooker) -> list[Outcome]:
        """Play an episode alone, beside those that are idle."""
        [outcomes] = self._together(scenario, [players], [seed])
        return outcomes

    def _together(
        self, scenario: str, seated: Sequence[Sequence[Player]], seeds: Sequence[int]
    ) -> list[list[Outcome]]:
        """What came of some episodes for the seats of each."""
        environment = self.environment(scenario)
        try:
            return self._steps(environment, seated, seeds)
        except BaseException:
            self.forget(scenario)
            raise

    def _steps(
        self, environment: Any, seated: Sequence[Sequence[Player]], seeds: Sequence[int]
    ) -> list[list[Outcome]]:
        names, count = list(environment.possible_agents), len(seated)
        seats = [{name: SeatRecord() for name in names} for _ in seated]
        playing = np.ones((count, len(names)), bool)
        idles = {name: idle(environment.action_space(name)) for name in names}
        padded = [seed % SEEDS for seed in (*seeds, *[seeds[-1]] * (self._size - count))]
        with during("reset"):
            observations, infos = environment.reset(seed=padded)
        for step in range(self.most_steps):
            if not playing.any():
                break
            with during(f"step {step}"):
                actions = {}
                for seat, name in enumerate(names):
                    seen, told = observations[name], infos[name]
                    done = {
                        row: seated[row][seat].act(_row(seen, row), _row(told, row).get("action_mask"))
                        for row in np.flatnonzero(playing[:, seat]).tolist()
                    }
                    rows = [np.asarray(done.get(row, idles[name])) for row in range(self._size)]
                    actions[name] = np.stack(rows)
                observations, rewards, ends, cuts, infos = environment.step(actions)
                for seat, name in enumerate(names):
                    gained, ended, cut = (self._each(name, one[name]) for one in (rewards, ends, cuts))
                    for row in np.flatnonzero(playing[:, seat]).tolist():
                        seats[row][name].steps += 1
                        seats[row][name].note(float(gained[row]), bool(ended[row]), _row(infos[name], row))
                    playing[:, seat] &= ~(ended | cut)[:count]
        return [[self.outcome(name, records[name]) for name in names] for records in seats]

    def _each(self, name: str, told: Any) -> NDArray[Any]:
        """What was told of every episode, (size,)."""
        array = np.asarray(told)
        if array.shape != (self._size,):
            raise WorldError(f"seat {name!r}: told of shape {array.shape}, expected ({self._size},)")
        return array


class _OneSeat:
    """A `VectorEnv` of Gymnasium as a `ParallelEnv` of arrays with one seat."""

    possible_agents = (ONLY,)

    def __init__(self, environment: Any) -> None:
        self._environment = environment

    def observation_space(self, _: str) -> Space:
        """As of ParallelEnv; so is the following."""
        space: Space = self._environment.single_observation_space
        return space

    def action_space(self, _: str) -> Space:
        space: Space = self._environment.single_action_space
        return space

    def reset(self, seed: Sequence[int]) -> Any:
        observations, infos = self._environment.reset(seed=list(seed))
        return {ONLY: observations}, {ONLY: infos}

    def step(self, actions: Mapping[str, Any]) -> Any:
        return tuple({ONLY: value} for value in self._environment.step(actions[ONLY]))

    def close(self) -> None:
        self._environment.close()


def _row(batch: Any, row: int) -> Any:
    """What of a batch belongs to an episode: of infos what was told of it, as `_KEY` says, or of all."""
    if isinstance(batch, Mapping):
        return {
            key: _row(value, row)
            for key, value in batch.items()
            if f"_{key}" not in batch or bool(batch[f"_{key}"][row])
        }
    if isinstance(batch, tuple):
        return tuple(_row(value, row) for value in batch)
    whole = getattr(batch, "shape", ()) or isinstance(batch, list)
    return batch[row] if whole else batch

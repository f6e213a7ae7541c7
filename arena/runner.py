"""Runs a match: one world for all its races, one matrix a policy and tick."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from arena.classification import classify
from arena.match import Match
from arena.results import RESULTS
from policies.policy import Batch, Policy
from sim.car import load_car
from sim.scenario import load_scenario
from sim.track import load_track
from sim.world import World

STUCK_S = 15.0
"""A car at rest for so long is out of the race."""

log = logging.getLogger(__name__)

Observer = Callable[[World], None]


class _Team:
    """One policy and all its cars in all races of a match."""

    def __init__(self, policy: Policy, races: NDArray[np.int64], cars: NDArray[np.int64]) -> None:
        self.policy, self.races, self.cars = policy, races, cars
        self.memory: Batch | None = None

    def act(self, world: World) -> tuple[Batch, NDArray[np.str_]]:
        """Actions (n, 2), and by car the fault of its policy or ''; a faulty action is 0."""
        n = len(self.races)
        try:
            if self.memory is None:
                self.memory = self.policy.initial_memory(n)
            seen = world.observe(self.policy.observation_spec, self.races, self.cars)
            actions, self.memory = self.policy.act(seen, self.memory)
        # Whatever a policy raises is its own fault and must not stop the others.
        except Exception:
            log.warning("a policy raised; its cars are out", exc_info=True)
            return np.zeros((n, 2), np.float32), np.full(n, "policy_raised")
        if not isinstance(actions, np.ndarray) or actions.shape != (n, 2) or actions.dtype.kind != "f":
            return np.zeros((n, 2), np.float32), np.full(n, "illegal_action")
        legal = np.asarray(np.isfinite(actions).all(axis=1))
        return np.where(legal[:, None], actions, 0.0), np.where(legal, "", "illegal_action")


def run_match(match: Match, policies: Sequence[Policy], observer: Observer | None = None) -> pl.DataFrame:
    """Run all races of a match to their end.

    Args:
        match: what to run.
        policies: one for each of the match's entrants.
        observer: called with the world before the first tick and after every tick.

    Returns:
        the results, one row a car a race, schema RESULTS.
    """
    scenario, track = load_scenario(match.scenario), load_track(match.circuit)
    world = World(track, load_car(match.car), len(match.races), scenario.cars)
    for index, race in enumerate(match.races):
        world.reset(index, scenario.place(track, np.random.default_rng(race.seed)))
    seats = np.array([[seat.entrant for seat in race.seats] for race in match.races])
    teams = [_Team(policy, *np.nonzero(seats == k)) for k, policy in enumerate(policies)]

    state = world.state
    endings = np.full(state.shape, "", dtype="U16")
    driven = np.zeros(state.shape)
    actions = np.zeros((*state.shape, 2), np.float32)
    if observer:
        observer(world)
    while state["driving"].any():
        for team in teams:
            mine = (team.races, team.cars)
            actions[mine], faults = team.act(world)
            _retire(endings, state, mine, faults)
        world.step(actions)
        _end(world, endings, driven, scenario.time_s)
        if observer:
            observer(world)
    rows = [
        row
        for index in range(len(match.races))
        for row in classify(match, index, state[index], endings[index], driven[index])
    ]
    return pl.DataFrame(rows, schema=RESULTS)


def _retire(
    endings: NDArray[np.str_],
    state: NDArray[np.void],
    mine: tuple[NDArray[np.int64], NDArray[np.int64]],
    faults: NDArray[np.str_],
) -> None:
    out = state["driving"][mine] & (faults != "")
    races, cars = mine[0][out], mine[1][out]
    endings[races, cars] = faults[out]
    state["driving"][races, cars] = False


def _end(world: World, endings: NDArray[np.str_], driven: NDArray[np.float64], time_s: float) -> None:
    """Note how runs ended in the last tick, and end those that are stuck or out of time."""
    state = world.state
    finished = ~state["driving"] & (endings == "")
    endings[finished] = "finished"
    stuck = state["driving"] & (state["stationary_s"] > STUCK_S)
    endings[stuck] = "stuck"
    state["driving"] &= ~stuck
    late = state["driving"] & (world.time >= time_s - 1e-9)[:, None]
    endings[late] = "time_up"
    state["driving"] &= ~late
    now = np.broadcast_to(world.time[:, None], driven.shape)
    ended = finished | stuck | late
    driven[ended] = np.where(finished, state["finish_s"], now)[ended]
    faulty = np.isin(endings, ("policy_raised", "illegal_action")) & (driven == 0.0)
    driven[faulty] = now[faulty]

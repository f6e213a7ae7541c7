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
from sim.episode import end_runs
from sim.reaction import Perception, Reaction
from sim.scenario import load_scenario
from sim.track import load_track
from sim.world import World

log = logging.getLogger(__name__)

Observer = Callable[[World], None]


class _Team:
    """One policy and all its cars in all races of a match."""

    def __init__(
        self, policy: Policy, races: NDArray[np.int64], cars: NDArray[np.int64], reaction: Reaction
    ) -> None:
        self.policy, self.races, self.cars = policy, races, cars
        self.memory: Batch | None = None
        self.perception = Perception(policy.observation_spec, races, cars, reaction)

    def act(self, world: World) -> tuple[Batch, NDArray[np.str_]]:
        """Actions (n, 2), and by car the fault of its policy or ''; a faulty action is 0.

        Cars whose turn it is not are asked as well, so that the batch keeps its shape, and their
        answers thrown away.
        """
        n = len(self.races)
        try:
            if self.memory is None:
                self.memory = self.policy.initial_memory(n)
            actions, memory = self.policy.act(self.perception.see(world), self.memory)
            self.memory = np.where(self.perception.due(world)[:, None], memory, self.memory)
        # Whatever a policy raises is its own fault and must not stop the others.
        except Exception as error:
            log.warning("a policy raised %r: its cars are out", error)
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
    world = scenario.world(track, load_car(match.car), len(match.races))
    reaction = scenario.reaction
    for index, race in enumerate(match.races):
        world.reset(index, scenario.place(track, np.random.default_rng(race.seed)))
    seats = np.array([[seat.entrant for seat in race.seats] for race in match.races])
    places = [np.nonzero(seats == entrant) for entrant in range(len(policies))]
    teams = [
        _Team(policy, races, cars, reaction) for policy, (races, cars) in zip(policies, places, strict=True)
    ]

    state = world.state
    endings = np.full(state.shape, "", dtype="U16")
    driven = np.zeros(state.shape)
    actions = np.zeros((*state.shape, 2), np.float32)
    if observer:
        observer(world)
    while state["driving"].any():
        for team in teams:
            mine = (team.races, team.cars)
            if not state["driving"][mine].any():
                continue
            answers, faults = team.act(world)
            due = team.perception.due(world)
            actions[mine] = np.where(due[:, None], answers, actions[mine])
            out = state["driving"][mine] & due & (faults != "")
            retired = (team.races[out], team.cars[out])
            endings[retired] = faults[out]
            driven[retired] = world.time[retired[0]]
            state["driving"][retired] = False
        running = endings == ""
        world.step(actions, reaction.tick)
        end_runs(world, endings, scenario.time_s)
        ended = running & (endings != "")
        now = np.where(endings == "finished", state["finish_s"], world.time[:, None])
        driven[ended] = now[ended]
        if observer:
            observer(world)
    rows = [
        row
        for index in range(len(match.races))
        for row in classify(match, index, state[index], endings[index], driven[index])
    ]
    return pl.DataFrame(rows, schema=RESULTS)

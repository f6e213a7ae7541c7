"""What a policy costs where it is deployed: time for an action, measured by itself, and size of its files.

Not in matches: there a policy answers for many cars at once, beside other work. Here it acts for one seat, on
one thread, while no other process of the pool is at work. And not on recorded observations: it sees what it
brings about itself, so that policies with a memory and planners do what they do at work.
"""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nathlon.arena.entrant import Entrant, weights
from nathlon.arena.job import Opening
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.processor import processor
from nathlon.arena.watch import Watch
from nathlon.arena.world import World
from nathlon.arena.world_registry import load_world
from nathlon.policies.driver.shown_plan import show_plans
from nathlon.policies.planning import decide
from nathlon.policies.policy import Policy, has_reverse
from nathlon.policies.sources import MPPI, PLUGIN, ROLES, is_path
from nathlon.policies.sources.identity import policy_id
from nathlon.policies.sources.normalisation import companions
from nathlon.policies.sources.roles import RolesSource
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.reaction import Perception
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

ALONE = "time_trial"
"""Scenario in which cars are timed."""
SEED = 20_260_807
WARM = 20
"""Answers that are not counted: the first ones load and compile."""
COUNTED = 500
"""That are."""
MOST_S = 10.0
"""Of the processor with the simulator's work, or of the policy's answers alone; slow planners give fewer."""
MS = 1000.0
OWN = 0, 0
"""Who is timed, as a `Watch` knows it: match and entrant."""


@dataclass(frozen=True)
class ActionCost:
    """What an action of one seat costs.

    Attributes:
        median_ms, p99_ms: time from observation to action, ms: median and 99th percentile. Time in which the
            process waited for a processor is not in it.
        actions: that were timed.
        model_bytes: of its files, which memory holds at least; None of what has none.
    """

    median_ms: float
    p99_ms: float
    actions: int
    model_bytes: int | None


TimedEntrant = tuple[Entrant, ActionCost | InputError]


def machine() -> str:
    """This machine, as one tells it from others: its name and its kind of processor."""
    return f"{platform.node()} ({processor()})"


def costed(entrant: Entrant) -> bool:
    """Whether an entrant's actions are timed.

    Those of built-in drivers, of people and of objects that were handed over are not: the first two are not
    deployed, and asking an object would change it.
    """
    return is_path(entrant.source) or entrant.source.partition(":")[0] in (MPPI, PLUGIN)


def action_costs(pool: Pool, entrants: Iterable[Entrant]) -> Iterator[TimedEntrant]:
    """What an action of each entrant costs, or why that is not known, one after the other."""
    for entrant in entrants:
        where = (entrant.source, entrant.world, entrant.circuit, entrant.car)
        [answer] = pool.open([Opening(entrant.source, measure, where)])
        yield entrant, answer


def measure(source: str, world: str, circuit: str, car: str) -> ActionCost:
    """What an action of a policy costs in this process.

    Raises:
        InputError: if it cannot be loaded, fails, or the world breaks down before it has been timed.
    """
    here = load_world(world, circuit, car)
    stopwatch = _Stopwatch()
    timed = _drive if here.circuits else _play
    timed(here, source, circuit, car, stopwatch)
    took = np.array(stopwatch.took_s)
    if not len(took):
        raise InputError(f"{source}: gave no action that could be timed, expected one for every observation")
    median, high = (round(float(ms), 4) for ms in np.quantile(took, [0.5, 0.99], method="higher") * MS)
    return ActionCost(median, high, len(took), model_bytes(source))


def model_bytes(source: str) -> int | None:
    """Size of the files of a policy and its parts; None of a plugin."""
    if source.partition(":")[0] == PLUGIN:
        return None
    parts = RolesSource.read(Path(source)).sources.values() if source.endswith(ROLES) else [source]
    files = {file for path in weights(parts) for file in (path, companions(path).weights) if file}
    return sum(file.stat().st_size for file in files)


class _EnoughError(BaseException):
    """All answers have been timed: no fault of anybody, so no handler of faults may stop it."""


class _Stopwatch(Watch):
    """Notes how long answers take."""

    def __init__(self) -> None:
        self.took_s: list[float] = []
        self._left, self._began_s = WARM, 0.0
        super().__init__(match_s=math.inf)

    def ask(self, match: int, entrant: int, first: bool) -> None:
        """As of `Watch`, where an episode's first answer is one like others."""
        super().ask(match, entrant, False)

    def _tell(self, match: int, entrant: int, limit_s: float) -> None:
        before_s = self._spent_s[OWN]
        super()._tell(match, entrant, limit_s)
        took_s = self._spent_s[OWN] - before_s
        if took_s > 0.0 and self._left:
            self._left -= 1
            self._began_s = time.process_time()
        elif took_s > 0.0:
            self.took_s.append(took_s)
            spent_s = max(time.process_time() - self._began_s, sum(self.took_s))
            if len(self.took_s) == COUNTED or spent_s > MOST_S:
                raise _EnoughError


def _drive(here: World, source: str, circuit: str, car: str, stopwatch: _Stopwatch) -> None:
    """Ask a policy for one car alone on the road."""
    scenario, track = load_scenario(ALONE), load_track(circuit)
    world = scenario.world(track, load_car(car), 1)
    world.reset(0, scenario.place(track, np.random.default_rng(SEED)))
    only = np.zeros(1, np.int64)
    policy: Policy = here.policy(source)
    show_plans(world, policy)
    world.state["has_reverse"] = has_reverse(policy)
    perception = Perception(policy.observation_spec, only, only, scenario.reaction)
    memory: Any = None
    try:
        while True:
            seen = perception.see(world)
            stopwatch.ask(*OWN, memory is None)
            if memory is None:
                memory = policy.initial_memory(1)
            actions, memory = decide(policy, world, only, only, seen, memory)
            stopwatch.work()
            world.step(np.asarray(actions, np.float32).reshape(1, 1, 2), scenario.reaction.tick)
    except _EnoughError:
        return


def _play(here: World, source: str, circuit: str, car: str, stopwatch: _Stopwatch) -> None:
    """Ask a policy in the first side's seats of a world, among others of its kind."""
    scenario = here.scenarios[0]
    setup = here.setup(scenario)
    baseline = here.baseline if setup.free else source
    sources = (source, source, baseline)
    seats = {seat: Seat(2) for seat in setup.free}
    for number, side in enumerate(setup.sides):
        seats |= dict.fromkeys(side, Seat(min(number, 1)))
    ordered = tuple(seats[seat] for seat in range(len(seats)))
    policy, other = here.policy(source), here.policy(baseline)
    ids = tuple(map(policy_id, sources))
    for seed in range(SEED, SEED + COUNTED):
        races = (Race(seed, ordered),)
        match = Match("cost", scenario, scenario, circuit, car, ids, sources, races, here.name)
        try:
            for _ in here.run({0: (match, (policy, policy, other))}, stopwatch):
                pass
        except _EnoughError:
            return
        if not stopwatch.took_s and seed > SEED + WARM:
            return

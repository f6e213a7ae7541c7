"""Cars that are measured while they drive: alone, or in traffic, with their policy as it is or planned."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.bundled import BUNDLED
from nathlon.policies.load import load_policy
from nathlon.policies.planning import decide
from nathlon.policies.policy import Policy
from nathlon.sim.car import Car, load_car
from nathlon.sim.clock import AGENT_DT
from nathlon.sim.conditions import Conditions
from nathlon.sim.instruments import Instruments, Transition
from nathlon.sim.physics.course import DRY, SurfaceGrip
from nathlon.sim.scenario import load_scenario
from nathlon.sim.state import CONTACT
from nathlon.sim.track import load_track
from nathlon.sim.tuning import Tuning, tune
from nathlon.sim.world import World

CIRCUIT, CAR = "lindenring", "gt3"
CHECKPOINT = BUNDLED / CIRCUIT / "lindenring-mend-059k.safetensors"
SUMMED = ("kerb", "out", "off_course", "wall")
PACES = (0.88, 0.93, 0.98)
"""Of the built-in drivers who are the traffic, as in the filter."""
NO_CONTACTS = np.zeros(0, CONTACT), np.zeros(0, np.int64)


class Setting(NamedTuple):
    """What is driven, and what for.

    Attributes:
        objective: of the planner.
        conditions, car: of the laps.
    """

    objective: str
    conditions: Conditions
    car: Car


class Field(NamedTuple):
    """Who drives where.

    Attributes:
        scenario: of the starts and the number of cars; in turn the first to the last is measured.
        races: how many.
        longest_s: when they end.
    """

    scenario: str
    races: int
    longest_s: float


WET = SurfaceGrip(tarmac=0.8, kerb=0.6, grass=0.5, gravel=0.8)
GT3 = load_car(CAR)
STAY = "-3 * out - 3 * (edge < 0.5 * m)"
SETTINGS = {
    "kerbs and edges avoided": Setting("-kerb - out", Conditions(), GT3),
    "half the wear": Setting(f"-600 * wear_rate * s {STAY}", Conditions(wear_rate=1.0), GT3),
    "wet road": Setting(STAY, Conditions(grip=WET), GT3),
    "15 % heavier": Setting(STAY, Conditions(), tune(GT3, Tuning(mass=1.15))),
}
ALONE, TRAFFIC = Field("time_trial", 2, 200.0), Field("1v7", 16, 40.0)


def planned(objective: str, checkpoint: Path = CHECKPOINT) -> str:
    """The source of a planner."""
    return f"mppi:{checkpoint}?objective={objective}"


def laps(source: str, setting: Setting) -> dict[str, float | None]:
    """Laps alone: means of a lap."""
    drive = Drive(source, setting, ALONE)
    lap_s = drive.state["last_lap_s"]
    finished = np.isfinite(lap_s)
    return {
        "lap_s": round(float(lap_s[finished].mean()), 3) if finished.any() else None,
        "laps_completed": float(finished.mean()),
        **{f"{name}_a_lap": round(drive.means[name], 2) for name in SUMMED},
        "wear_a_lap": round(float(drive.state["wear"].mean()), 5),
        "decision_ms": drive.decision_ms,
    }


def traffic(source: str, setting: Setting) -> dict[str, float]:
    """Some time among others: means of a car."""
    drive = Drive(source, setting, TRAFFIC)
    return {
        "km": round(float((drive.state["progress"] - drive.state["start"]).mean()) / 1000.0, 3),
        "contacts": int(drive.state["contacts"].sum()),
        "contacts_at_fault": int(drive.state["contacts_at_fault"].sum()),
        **{name: round(drive.means[name], 2) for name in SUMMED},
        "wear": round(float(drive.state["wear"].mean()), 5),
        "decision_ms": drive.decision_ms,
    }


class Drive:
    """What came of driving.

    Attributes:
        state: (races,) CAR_STATE of the measured cars at the end.
        means: of SUMMED, summed over the steps that a car drives.
        decision_ms: processor time of a decision for one car.
    """

    def __init__(self, source: str, setting: Setting, field: Field) -> None:
        """Drive all races of a field."""
        scenario, track = load_scenario(field.scenario), load_track(CIRCUIT)
        races = np.arange(field.races)
        cars = races % scenario.cars
        world = World(track, setting.car, field.races, scenario.cars, setting.conditions)
        for race in races.tolist():
            world.reset(race, scenario.place(track, np.random.default_rng(race)))
        measured = _Crew(load_policy(source, CIRCUIT, CAR), races, cars)
        others = _traffic(setting.conditions.grip, cars, scenario.cars)
        instruments = Instruments(track, setting.car, AGENT_DT)
        actions, sums, decisions = np.zeros((*world.state.shape, 2)), dict.fromkeys(SUMMED, 0.0), 0
        while world.state["driving"].any() and world.time[0] < field.longest_s:
            for crew in (measured, *others):
                crew.act(world, actions)
            before = world.state.copy()
            driving = before["driving"][races, cars]
            decisions += int(driving.sum())
            world.step(actions)
            read = instruments.read(SUMMED, Transition(before, world.state, *NO_CONTACTS))
            for name in SUMMED:
                sums[name] += float(read[name][races, cars][driving].sum())
        self.state: NDArray[np.void] = world.state[races, cars]
        self.means = {name: value / field.races for name, value in sums.items()}
        self.decision_ms = round(1000.0 * measured.used_s / decisions, 2)


def decision_times(objective: str, decisions: int = 30) -> dict[str, float]:
    """Processor time of a decision, ms: one planned car of eight, and all eight in one batch."""
    track, scenario = load_track(CIRCUIT), load_scenario(TRAFFIC.scenario)
    found = {}
    for name, count in (("one_of_eight_ms", 1), ("all_eight_ms", scenario.cars)):
        world = World(track, GT3, 1, scenario.cars)
        world.reset(0, scenario.place(track, np.random.default_rng(0)))
        crew = _Crew(
            load_policy(planned(objective), CIRCUIT, CAR), np.zeros(count, np.int64), np.arange(count)
        )
        actions = np.zeros((1, scenario.cars, 2))
        actions[:, :, 0] = 0.3
        crew.act(world, actions)
        crew.used_s = 0.0
        for _ in range(decisions):
            world.step(actions)
            crew.act(world, actions)
        found[name] = round(1000.0 * crew.used_s / decisions, 1)
    return found


class _Crew:
    """A policy and the cars that it drives.

    Attributes:
        used_s: processor time of its decisions.
    """

    def __init__(self, policy: Policy, races: NDArray[np.int64], cars: NDArray[np.int64]) -> None:
        self._policy, self._where = policy, (races, cars)
        self._memory = policy.initial_memory(len(races))
        self.used_s = 0.0

    def act(self, world: World, actions: NDArray[np.float64]) -> None:
        """Fill in what its cars do."""
        seen = world.observe(self._policy.observation_spec, *self._where)
        began = time.process_time()
        answer, self._memory = decide(self._policy, world, *self._where, seen, self._memory)
        self.used_s += time.process_time() - began
        actions[self._where] = answer


def _traffic(grip: SurfaceGrip, measured: NDArray[np.int64], cars: int) -> list[_Crew]:
    """Built-in drivers in the places of a race that are not the measured car's, one pace after the other."""
    wise = "" if grip == DRY else f",grip={grip.tarmac}"
    races, others = np.nonzero(np.arange(cars) != measured[:, None])
    which = (races + others) % len(PACES)
    crews = []
    for index, pace in enumerate(PACES):
        if (mine := which == index).any():
            policy = load_policy(f"driver:pace={pace}{wise}", CIRCUIT, CAR)
            crews.append(_Crew(policy, races[mine], others[mine]))
    return crews


def compare(measure: Any, setting: Setting) -> dict[str, Any]:
    """A measure of the bare policy and of the planned one."""
    return {
        "objective": setting.objective,
        "bare": measure(str(CHECKPOINT), setting),
        "planned": measure(planned(setting.objective), setting),
    }

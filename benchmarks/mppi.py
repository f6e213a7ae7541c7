"""What planning around a policy brings and costs: laps of the Lindenring with another aim, road or car.

Run as `OPENBLAS_NUM_THREADS=1 python -m benchmarks.mppi [--json FILE]`. In each setting the bundled champion
drives laps as it is, and planned for an objective (`mppi:CHECKPOINT?objective=...`), from the same rolling
starts. The last line of the output is one JSON object by setting: lap time, tyres on kerbs and beyond them
summed over steps of 0.1 s, time off course and at walls, and wear of the tyres, each a lap; and the processor
time of a decision for one car.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.result import write_result
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.load import load_policy
from nathlon.policies.planning import decide
from nathlon.sim.car import Car, load_car
from nathlon.sim.instruments import Instruments, Transition
from nathlon.sim.physics.course import SurfaceGrip
from nathlon.sim.scenario import load_scenario
from nathlon.sim.state import CONTACT
from nathlon.sim.track import load_track
from nathlon.sim.tuning import Tuning, tune
from nathlon.sim.world import AGENT_DT, Conditions, World

CIRCUIT, CAR = "lindenring", "gt3"
CHECKPOINT = BUNDLED / CIRCUIT / "lindenring-mend-059k.safetensors"
LAPS = 2
LONGEST_S = 200.0
SUMMED = ("kerb", "out", "off_course", "wall")
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


WET = SurfaceGrip(tarmac=0.8, kerb=0.6, grass=0.5, gravel=0.8)
GT3 = load_car(CAR)
SETTINGS = {
    "kerbs and edges avoided": Setting("-kerb - out", Conditions(), GT3),
    "tyres spared": Setting("-600 * wear_rate * s - out", Conditions(wear_rate=1.0), GT3),
    "wet road": Setting("-3 * out - 3 * (edge < 0.5 * m)", Conditions(grip=WET), GT3),
    "15 % heavier": Setting("-3 * out - 3 * (edge < 0.5 * m)", Conditions(), tune(GT3, Tuning(mass=1.15))),
}


def drive(source: str, setting: Setting) -> dict[str, float | None]:
    """Laps by a policy, all in one world: means of a lap."""
    policy, track = load_policy(source, CIRCUIT, CAR), load_track(CIRCUIT)
    world = World(track, setting.car, LAPS, 1, setting.conditions)
    for race in range(LAPS):
        world.reset(race, load_scenario("time_trial").place(track, np.random.default_rng(race)))
    races, cars = np.arange(LAPS), np.zeros(LAPS, np.int64)
    instruments, memory = Instruments(track, setting.car, AGENT_DT), policy.initial_memory(LAPS)
    sums, decisions, planned_s = dict.fromkeys(SUMMED, 0.0), 0, 0.0
    while world.state["driving"].any() and world.time[0] < LONGEST_S:
        seen = world.observe(policy.observation_spec, races, cars)
        began = time.process_time()
        actions, memory = decide(policy, world, races, cars, seen, memory)
        planned_s += time.process_time() - began
        driving = world.state["driving"].copy()
        decisions += int(driving.sum())
        before = world.state.copy()
        world.step(actions[:, None])
        read = instruments.read(SUMMED, Transition(before, world.state, *NO_CONTACTS))
        for name in SUMMED:
            sums[name] += float(read[name][driving].sum())
    finished = np.isfinite(world.state["last_lap_s"])
    return {
        "lap_s": round(float(world.state["last_lap_s"][finished].mean()), 3) if finished.any() else None,
        "laps_completed": float(finished.mean()),
        **{f"{name}_a_lap": round(value / LAPS, 2) for name, value in sums.items()},
        "wear_a_lap": round(float(world.state["wear"].mean()), 5),
        "decision_ms": round(1000.0 * planned_s / decisions, 2),
    }


def main() -> None:
    """Drive, print the figures as JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    chosen = parser.parse_args()
    figures = {}
    for name, setting in SETTINGS.items():
        planned = f"mppi:{CHECKPOINT}?objective={setting.objective}"
        figures[name] = {
            "objective": setting.objective,
            "laps": LAPS,
            "bare": drive(str(CHECKPOINT), setting),
            "planned": drive(planned, setting),
        }
        print(name, figures[name], flush=True)
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()

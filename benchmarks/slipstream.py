"""What a slipstream is worth on the longest straight: two equal cars, one 15 m behind the other.

Run as `python -m benchmarks.slipstream [--json FILE] [--picture FILE]`. Both cars enter the straight at the
speed of the built-in driver and go flat out; the one behind stays in the wake until it is close, then pulls
out and passes. The last line of the output is one JSON object by circuit, with the distance from tail to
nose at the start of the straight, the distance gained up to the built-in driver's braking point, what it
takes to be past (the gap and two lengths of car), and what is gained without a wake, from the lane beside.
The picture shows the gap over the straight.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from benchmarks.result import write_result
from nathlon.policies.driver import Driver
from nathlon.sim.car import load_car
from nathlon.sim.conditions import Start
from nathlon.sim.track import load_track
from nathlon.sim.world import World

PAIRS = {"porto-sereno": "coupe", "lindenring": "gt3", "grandes-landes": "prototype"}
GAP_M = 15.0
PULL_OUT_M = 4.0
"""Tail to nose at which the car behind leaves the wake."""
ASIDE_M = 2.6


class Straight(NamedTuple):
    """The longest straight as the built-in driver drives it: entry and braking point, m, and speed there."""

    entry_m: float
    speed_m_s: float
    braking_m: float


class Run(NamedTuple):
    """Progress of the leader (m) and how far its tail is ahead of the other's nose (m), step by step."""

    leader_m: NDArray[np.float64]
    gap_m: NDArray[np.float64]


def drive_lap(circuit: str, car: str) -> Straight:
    """Where the built-in driver enters the longest straight and brakes for its end."""
    track = load_track(circuit)
    begin, end = track.stretch("longest straight")
    driver, world = Driver(circuit, car), World(track, load_car(car), 1, 1)
    zero, race = np.zeros(1), np.zeros(1, np.int64)
    world.reset(0, Start(np.array([-50.0]), zero, zero, np.array([20.0]), np.array([end + 100.0])))
    memory = driver.initial_memory(1)
    entry = speed = 0.0
    state = world.state[0, 0]
    while state["driving"]:
        actions, memory = driver.act(world.observe(driver.observation_spec, race, race), memory)
        world.step(actions[None])
        if state["progress"] >= begin and entry == 0.0:
            entry, speed = float(state["progress"]), float(state["velocity_x"])
        if state["progress"] > 0.5 * (begin + end) and state["brake"] > 0.3:
            return Straight(entry, speed, float(state["progress"]))
    return Straight(entry, speed, end)


def follow(circuit: str, car: str, straight: Straight, lane_m: float) -> Run:
    """Two cars flat out up to the braking point, the second `lane_m` beside the first."""
    track, model = load_track(circuit), load_car(car)
    world = World(track, model, 1, 2)
    length = model.body.length_m
    aside = np.array([0.0, lane_m])
    world.reset(
        0,
        Start(
            straight.entry_m - np.array([0.0, GAP_M + length]),
            aside,
            np.zeros(2),
            np.full(2, straight.speed_m_s),
            np.full(2, np.inf),
        ),
    )
    cars, wanted, rows = world.state[0], aside.copy(), []
    while cars["progress"].max() < straight.braking_m:
        gap = cars["progress"][0] - cars["progress"][1] - length
        if abs(gap) < PULL_OUT_M:
            wanted[1] = ASIDE_M
        steering = 0.02 * np.clip(wanted - cars["lateral"], -1.5, 1.5) - 0.8 * cars["heading_error"]
        world.step(np.stack([np.ones(2), steering], axis=1)[None])
        rows.append((cars["progress"][0], gap))
    return Run(*np.array(rows).T)


def main() -> None:
    """Measure, draw, print the figures as JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    parser.add_argument("--picture", type=Path, metavar="FILE")
    chosen = parser.parse_args()
    figure, panels = plt.subplots(1, len(PAIRS), figsize=(13, 3.8), layout="constrained")
    figures = {}
    for panel, (circuit, car) in zip(panels, PAIRS.items(), strict=True):
        straight = drive_lap(circuit, car)
        inside, beside = (follow(circuit, car, straight, lane) for lane in (0.0, ASIDE_M + 2.0))
        figures[circuit] = {
            "car": car,
            "gap_m": GAP_M,
            "needed_m": GAP_M + 2.0 * load_car(car).body.length_m,
            "gained_m": round(float(inside.gap_m[0] - inside.gap_m[-1]), 1),
            "gained_without_wake_m": round(float(beside.gap_m[0] - beside.gap_m[-1]), 1),
        }
        for run, label in ((inside, "in the wake, then passing"), (beside, "from the lane beside")):
            panel.plot(run.leader_m - straight.entry_m, run.gap_m, label=label)
        panel.axhline(-load_car(car).body.length_m, color="grey", ls=":", label="past")
        panel.set(title=f"{circuit}, {car}", xlabel="distance on the straight, m")
    panels[0].set_ylabel("tail to nose, m")
    panels[0].legend(fontsize=8)
    if chosen.picture:
        figure.savefig(chosen.picture, dpi=110)
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()

"""How a policy in training laps, measured the same way every time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from nathlon.policies.driver.shown_plan import show_plans
from nathlon.policies.policy import Policy, trained_with_reverse
from nathlon.policies.training.pairs import Pair
from nathlon.sim.car import load_car
from nathlon.sim.clock import DYNAMICS_HZ
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

SCENARIO = "time_trial"
RUNS = 4
PATIENCE_S, PROGRESS_M, ON_COURSE_S = 20.0, 200.0, 1.0


class LapEvaluation(NamedTuple):
    """Of `RUNS` time trials: mean lap time (nan unless all were completed) and share of time off course.

    A trial also ends where a car gets nowhere in `PATIENCE_S`, as policies do that have hardly learnt
    anything: it comes to no more than `PROGRESS_M`, or hardly touches the course.
    """

    lap_s: float
    off_course_share: float


def evaluate_laps(pair: Pair, policy: Policy, seed: int) -> LapEvaluation:
    """Drive the time trial from a few starts.

    Args:
        pair: circuit, car and grip.
        policy: drives.
        seed: of the starts.
    """
    spec, memory = policy.observation_spec, policy.initial_memory(RUNS)
    scenario, track = pair.conditions(load_scenario(SCENARIO)), load_track(pair.circuit)
    world = scenario.world(track, load_car(pair.car), RUNS)
    show_plans(world, policy)
    world.state["has_reverse"] = trained_with_reverse(spec)
    rng = np.random.default_rng(seed)
    for race in range(RUNS):
        world.reset(race, scenario.place(track, rng))
    races, cars = np.arange(RUNS), np.zeros(RUNS, np.int64)
    state, driven = world.state[:, 0], np.zeros(RUNS)
    reached, strayed = np.full(RUNS, -np.inf), np.zeros(RUNS)
    while state["driving"].any() and world.time[0] < scenario.time_s:
        if world.ticks[0] % round(PATIENCE_S * DYNAMICS_HZ) == 0:
            state["driving"] &= state["progress"] - reached > PROGRESS_M
            state["driving"] &= state["off_course_s"] - strayed < PATIENCE_S - ON_COURSE_S
            reached, strayed = state["progress"].copy(), state["off_course_s"].copy()
        driving = state["driving"].copy()
        actions, memory = policy.act(world.observe(spec, races, cars), memory)
        world.step(actions[:, None])
        driven[driving] = world.time[0]
    driven = np.where(np.isnan(state["finish_s"]), driven, state["finish_s"])
    return LapEvaluation(float(state["best_lap_s"].mean()), float(state["off_course_s"].sum() / driven.sum()))


def mean_laps(evaluations: Iterable[LapEvaluation]) -> LapEvaluation:
    """The mean over circuits and cars."""
    return LapEvaluation(*(float(mean) for mean in np.mean(list(evaluations), axis=0)))

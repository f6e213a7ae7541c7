"""What champions lack of strategy in traffic: waiting for a penalty, and keeping a place on a straight.

Run as `OPENBLAS_NUM_THREADS=1 python -m benchmarks.waiting --json FILE [--seeds N] [--races N] [--paced]`,
for the champion of each circuit; with `--paced` for PACED on each, which takes a pace, and `behind` alone.

`behind`: it starts 10 to 16 m behind the built-in driver, and both drive from the line through the first
penalty zone, `seeds` times each

- `free`: nobody has a penalty;
- `penalised`: the car ahead has 5 s to serve, and will be slow in the zone;
- `told`: likewise, and the champion is told to wait: a controller keeps it 12 m behind up to the zone. It
  stands in for the pace target of a strategist, which champions do not know.

PACED follows the built-in driver at pace AHEAD, and is `told` a pace ten times a second that keeps it 12 m
behind.

Of each: the share of runs in which it tried to pass before the zone (its nose was beside the other car) and
in which it did (by a length), contacts a run before the zone, and in all those that were its fault; the
share of them that it `finished`, in which it was `ahead` then, and its mean time, s. `changed_m` is by how
much the penalty changed where the champion was before the zone.

`straights`: copies of one policy, the champion or the built-in driver, against each other in
`slipstream_pass` (two cars, `seeds` times) and `race` (eight cars, `races` times): `passes` on a straight or
in the corner behind it, and the share of them that was `lost` again before the end of the same one.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.result import write_result
from nathlon.policies.bundled import champions
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.driver import Driver
from nathlon.policies.driver.shown_plan import show_plan
from nathlon.policies.planning import decide
from nathlon.policies.policy import Policy, takes_pace
from nathlon.policies.strategy import PACE
from nathlon.sim.car import load_car
from nathlon.sim.episode import end_runs
from nathlon.sim.scenario import load_scenario
from nathlon.sim.state import CAR_STATE
from nathlon.sim.track import ZONE, Track, load_track
from nathlon.sim.world import World

BEHIND = str(Path(__file__).with_name("penalised_ahead.toml"))
PENALTY_S = 5.0
KEEP_M = 12.0
"""Tail to nose at which who is told to wait does."""
EXIT_M = 130.0
"""Behind the end of a straight, in which a pass still belongs to it."""
PACED = Path(__file__).parent / "ladders" / "generalist" / "generalist-racer-007k.safetensors"
AHEAD = 0.9
"""Pace of the car ahead of it: slow enough to be passed."""
CLOSING = 0.3
"""m/s by which who is told a pace is to be faster for each metre that it is too far behind."""
SORTED_S = 10.0
"""So long a grid sorts itself out."""

CHASES = {"free": (0.0, False), "penalised": (PENALTY_S, False), "told": (PENALTY_S, True)}
"""Seconds that the car ahead has to serve, and whether the other one is told to wait."""

NOTED = np.dtype(
    [
        (name, CAR_STATE[name])
        for name in ("progress", "driving", "contacts", "contacts_at_fault", "penalty_s", "off_course")
    ]
)
"""Fields of CAR_STATE."""

Floats = NDArray[np.float64]
Actor = Callable[[World], NDArray[np.float32]]


class Trace(NamedTuple):
    """Races tick by tick.

    Attributes:
        time_s: (ticks,).
        cars: (ticks, races, cars) NOTED.
        finish_s: (races, cars), nan for who did not finish.
    """

    time_s: Floats
    cars: NDArray[np.void]
    finish_s: Floats


def driven(
    scenario: str, circuit: str, car: str, seeds: Sequence[int], penalty_s: float, act: Actor
) -> Trace:
    """Races of a scenario, the first car of each with a penalty, until nobody drives any more."""
    told, track = load_scenario(scenario), load_track(circuit)
    world = told.world(track, load_car(car), len(seeds))
    show_plan(world)
    for race, seed in enumerate(seeds):
        world.reset(race, told.place(track, np.random.default_rng(seed)))
    world.state["penalty_s"][:, 0] = penalty_s
    endings = np.full(world.state.shape, "", "U16")
    times, cars = [0.0], [noted(world)]
    while world.state["driving"].any():
        world.step(act(world))
        end_runs(world, endings, told.time_s)
        times.append(float(world.time[0]))
        cars.append(noted(world))
    return Trace(np.array(times), np.stack(cars), world.state["finish_s"].copy())


def noted(world: World) -> NDArray[np.void]:
    """The present state of all cars, NOTED."""
    return world.state[list(NOTED.names or ())].astype(NOTED)


def driver_of(policy: Policy, cars: NDArray[np.int64], races: int) -> Actor:
    """Has a policy drive some cars of every race; its answers are (races, cars, 2)."""
    rows, columns = np.repeat(np.arange(races), len(cars)), np.tile(cars, races)
    memory = policy.initial_memory(len(rows))

    def act(world: World) -> NDArray[np.float32]:
        nonlocal memory
        seen = world.observe(policy.observation_spec, rows, columns)
        actions, memory = decide(policy, world, rows, columns, seen, memory)
        return actions.reshape(races, len(cars), 2)

    return act


def chase(
    chaser: Policy,
    circuit: str,
    car: str,
    seeds: Sequence[int],
    penalty_s: float = 0.0,
    told: bool = False,
    pace: float = 1.0,
) -> Trace:
    """A policy behind the built-in driver at a pace; if it takes a pace itself, it is told one to wait."""
    ahead = driver_of(Driver(circuit, car, pace), np.array([0]), len(seeds))
    behind = driver_of(chaser, np.array([1]), len(seeds))
    length_m, zone_m = load_car(car).body.length_m, first_zone_m(load_track(circuit))

    def act(world: World) -> NDArray[np.float32]:
        first, second = world.state[:, 0], world.state[:, 1]
        gap_m = first["progress"] - second["progress"] - length_m
        waits = told & (first["progress"] < zone_m) & (gap_m > -length_m)
        if takes_pace(chaser):
            wanted = first["velocity_x"] + CLOSING * (gap_m - KEEP_M)
            paced = second["pace"] * wanted / np.maximum(second["velocity_x"], 1.0)
            second["pace"] = np.where(waits, np.clip(paced, PACE[0], 1.0), 1.0)
        actions = np.concatenate([ahead(world), behind(world)], axis=1)
        if not takes_pace(chaser):
            closing = second["velocity_x"] - first["velocity_x"]
            most = np.clip(0.1 * (gap_m - KEEP_M) - 0.2 * closing, -1.0, 1.0)
            actions[waits, 1, 0] = np.minimum(actions[waits, 1, 0], most[waits])
        return actions

    return driven(BEHIND, circuit, car, seeds, penalty_s, act)


def first_zone_m(track: Track) -> float:
    """Where the first penalty zone behind the line begins, m."""
    return float(np.flatnonzero(track.table[:, ZONE])[0] * track.spacing)


def told_of(trace: Trace, zone_m: float, length_m: float) -> dict[str, float | None]:
    """The figures of runs behind a car; see the top."""
    progress = trace.cars["progress"]
    lead_m = progress[..., 1] - progress[..., 0]
    before = np.logical_and.accumulate(progress[..., 0] < zone_m, axis=0)
    at_zone = before.sum(axis=0) - 1, np.arange(before.shape[1]), 1
    of_first, finish_s = trace.finish_s.T
    came = np.isfinite(finish_s)
    return {
        "tried": mean((before & (lead_m > -length_m)).any(axis=0)),
        "passed": mean((before & (lead_m > length_m)).any(axis=0)),
        "contacts_before": mean(trace.cars["contacts"][at_zone]),
        "at_fault_before": mean(trace.cars["contacts_at_fault"][at_zone]),
        "at_fault": mean(trace.cars["contacts_at_fault"][-1, :, 1]),
        "finished": mean(came),
        "ahead": mean(came & ~(of_first <= finish_s)),
        "mean_s": mean(finish_s[came]) if came.any() else None,
    }


def mean(numbers: NDArray[Any]) -> float:
    """Rounded."""
    return round(float(numbers.mean()), 3)


def changed_m(free: Trace, penalised: Trace, zone_m: float) -> float:
    """By how much the place of the second car differs before the first one comes to the zone, at most."""
    ticks = min(len(free.time_s), len(penalised.time_s))
    one, other = free.cars["progress"][:ticks], penalised.cars["progress"][:ticks]
    before = np.logical_and.accumulate(one[..., 0] < zone_m, axis=0)
    return float(np.abs(one[..., 1] - other[..., 1])[before].max())


def changes(gap_m: Floats, length_m: float) -> int:
    """How often the lead of two changes hands; who is a length ahead leads."""
    leads = np.sign(gap_m[np.abs(gap_m) > length_m])
    return int(np.count_nonzero(leads[1:] != leads[:-1]))


def spells(mask: NDArray[np.bool_]) -> list[slice]:
    """The stretches of ticks in which a mask, (ticks,), holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [slice(begin, end) for begin, end in edges.reshape(-1, 2).tolist()]


def passes_on_straights(trace: Trace, track: Track, length_m: float) -> dict[str, float | None]:
    """Passes on all straights, and the share of them that was lost again on the same one.

    Cars that are penalised or off course count for nothing: they give their place away.
    """
    fit = trace.cars["driving"] & ~trace.cars["off_course"] & (trace.cars["penalty_s"] <= 0.0)
    fit &= (trace.time_s >= SORTED_S)[:, None, None]
    progress, passed, lost = trace.cars["progress"], 0, 0
    for straight in track.sections:
        if straight.kind != "straight":
            continue
        reach_m = straight.end_m - straight.start_m + EXIT_M
        there = fit & (np.mod(progress - straight.start_m, track.length) < reach_m)
        for race in range(progress.shape[1]):
            for first, second in combinations(range(progress.shape[2]), 2):
                gap_m = progress[:, race, first] - progress[:, race, second]
                both = there[:, race, first] & there[:, race, second] & (np.abs(gap_m) < reach_m)
                counts = [changes(gap_m[spell], length_m) for spell in spells(both)]
                passed += sum(counts)
                lost += sum(max(count - 1, 0) for count in counts)
    return {"passes": passed, "lost": round(lost / passed, 3) if passed else None}


def among_themselves(policy: Policy, scenario: str, circuit: str, car: str, seeds: Sequence[int]) -> Trace:
    """Races of copies of one policy."""
    cars = load_scenario(scenario).cars
    return driven(scenario, circuit, car, seeds, 0.0, driver_of(policy, np.arange(cars), len(seeds)))


def measure(path: Path, seeds: Sequence[int], races: Sequence[int]) -> dict[str, Any]:
    """The figures of a champion."""
    champion = load_checkpoint(path)
    circuit, car = champion.card.circuit, champion.card.car
    track, length_m = load_track(circuit), load_car(car).body.length_m
    zone_m = first_zone_m(track)
    chases = {name: chase(champion, circuit, car, seeds, *asked) for name, asked in CHASES.items()}
    policies: dict[str, Policy] = {"champion": champion, "driver": Driver(circuit, car)}
    return {
        "policy": path.stem,
        "car": car,
        "zone_m": zone_m,
        "behind": {name: told_of(trace, zone_m, length_m) for name, trace in chases.items()},
        "changed_m": changed_m(chases["free"], chases["penalised"], zone_m),
        "straights": {
            scenario: {
                name: passes_on_straights(
                    among_themselves(policy, scenario, circuit, car, those), track, length_m
                )
                for name, policy in policies.items()
            }
            for scenario, those in (("slipstream_pass", seeds), ("race", races))
        },
    }


def measure_paced(circuit: str, car: str, seeds: Sequence[int]) -> dict[str, Any]:
    """The figures of PACED on a circuit."""
    policy, track, length_m = load_checkpoint(PACED), load_track(circuit), load_car(car).body.length_m
    zone_m = first_zone_m(track)
    chases = {name: chase(policy, circuit, car, seeds, *asked, AHEAD) for name, asked in CHASES.items()}
    behind = {name: told_of(trace, zone_m, length_m) for name, trace in chases.items()}
    return {"policy": PACED.stem, "car": car, "zone_m": zone_m, "behind": behind}


def main() -> None:
    """Measure, and print the figures as one JSON object."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--races", type=int, default=10)
    parser.add_argument("--paced", action="store_true", help="a policy that takes a pace")
    options = parser.parse_args()
    seeds, races = range(1, options.seeds + 1), range(1, options.races + 1)
    circuits = {}
    for path in champions():
        card = load_checkpoint(path).card
        paced = options.paced
        figures = measure_paced(card.circuit, card.car, seeds) if paced else measure(path, seeds, races)
        circuits[card.circuit] = figures
        print(json.dumps(figures), flush=True)
    told = {"seeds": options.seeds, "races": options.races, "circuits": circuits}
    write_result(options.json, told)
    print(json.dumps(told))


if __name__ == "__main__":
    main()

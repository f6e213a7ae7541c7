"""What a step and an observation need of arithmetic, counted, beside the cycles that they take.

Run as `python -m benchmarks.arithmetic [--json FILE]`; prints a table. Counted is what the kernels' source
does with numbers that count what is done with them, a car in a race of eight under random actions. The
compiler needs less: it fuses multiplications with additions and takes out of the loop what does not change.
What is done with a vector of four counts once.

The least cycles are those of the busiest unit of a core (AMD Zen 3): two multiplications and two
additions or comparisons each cycle, a division in five, a root in nine
(Abel & Reineke, uops.info). The clock is read off additions that wait for each other, three cycles each.
"""

from __future__ import annotations

import argparse
import math
import operator
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher
from rich.console import Console
from rich.table import Table

from benchmarks.result import write_result
from benchmarks.world import CAR, CIRCUIT, SCENARIOS, SPEC, cost, random_drive, seats
from nathlon.sim import observation_kernel, race_step
from nathlon.sim import simd as lanes
from nathlon.sim.car import load_car
from nathlon.sim.clock import SUBSTEPS
from nathlon.sim.kernel import kernel
from nathlon.sim.observation_parameters import layout_parameters
from nathlon.sim.physics.tyre import Ground
from nathlon.sim.scenario import load_scenario
from nathlon.sim.simd import LANES
from nathlon.sim.state import RaceRows
from nathlon.sim.track import load_track
from nathlon.sim.world import World

CARS = 8
WARM_UP = 20
"""Steps before those that are counted."""
STEPS = 10
ADDITION = 3
"""Cycles from addition to addition."""
DIVISION, ROOT = 5.0, 9.0
CHAIN = 20_000_000

done: Counter[str] = Counter()


class Number(float):
    """A number that counts what is done with it."""


def _counting(kind: str, function: Callable[..., float], swapped: bool = False) -> Callable[..., Any]:
    def counted(*arguments: Any) -> Any:
        done[kind] += 1
        result = function(*map(float, arguments[::-1] if swapped else arguments))
        return result if isinstance(result, bool) else Number(result)

    return counted


for _kind, _name in (("add", "add"), ("add", "sub"), ("multiply", "mul"), ("divide", "truediv")):
    setattr(Number, f"__{_name}__", _counting(_kind, getattr(operator, _name)))
    setattr(Number, f"__r{_name}__", _counting(_kind, getattr(operator, _name), swapped=True))
for _name in ("lt", "le", "gt", "ge"):
    setattr(Number, f"__{_name}__", _counting("compare", getattr(operator, _name)))
for _kind, _name in (("sign", "neg"), ("sign", "abs")):
    setattr(Number, f"__{_name}__", _counting(_kind, getattr(operator, _name)))

MATH = SimpleNamespace(
    pi=math.pi,
    inf=math.inf,
    sqrt=_counting("root", math.sqrt),
    copysign=_counting("sign", math.copysign),
    floor=math.floor,
    **{name: _counting("function", getattr(math, name)) for name in ("sin", "cos", "atan2", "exp")},
)


def _lanes(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,) * LANES


def _counting_lanes(kinds: tuple[str, ...], function: Callable[..., Any]) -> Callable[..., Any]:
    def counted(*vectors: Any) -> Any:
        done.update(kinds)
        results = [function(*map(float, numbers)) for numbers in zip(*map(_lanes, vectors), strict=True)]
        return tuple(each if isinstance(each, bool) else Number(each) for each in results)

    return counted


def _store(row: Any, at: int, vector: Any) -> None:
    row[at : at + LANES] = vector


VECTORS = {
    "load": lambda row, at: tuple(row[at : at + LANES]),
    "store": _store,
    "add": _counting_lanes(("add",), operator.add),
    "subtract": _counting_lanes(("add",), operator.sub),
    "multiply": _counting_lanes(("multiply",), operator.mul),
    "divide": _counting_lanes(("divide",), operator.truediv),
    "fma": _counting_lanes(("multiply", "add"), lambda a, b, c: a * b + c),
    "sqrt": _counting_lanes(("root",), math.sqrt),
    "greater": _counting_lanes(("compare",), operator.gt),
    "logical_or": lambda a, b: tuple(x or y for x, y in zip(a, b, strict=True)),
    "select": lambda where, a, b: tuple(
        x if true else y for true, x, y in zip(where, _lanes(a), _lanes(b), strict=True)
    ),
    "negate": _counting_lanes(("sign",), operator.neg),
    "absolute": _counting_lanes(("sign",), abs),
    "copysign": _counting_lanes(("sign",), math.copysign),
}


def number(value: Any) -> Any:
    """The same value of numbers that count: arrays, tuples and records of them too."""
    if isinstance(value, np.void):
        return SimpleNamespace(**{name: number(value[name]) for name in value.dtype.names or ()})
    if isinstance(value, np.ndarray):
        if value.dtype.kind != "f":
            return value
        return np.vectorize(Number, otypes=[object])(value)
    if isinstance(value, tuple):
        return type(value)(*map(number, value)) if hasattr(value, "_fields") else tuple(map(number, value))
    if isinstance(value, np.generic):
        value = value.item()
    return Number(value) if isinstance(value, float) else value


def uncompile() -> None:
    """Have the simulator's kernels call each other's source, with functions that count."""
    vectors = {key: getattr(lanes, key) for key in VECTORS}
    for name, module in list(sys.modules.items()):
        if not name.startswith("nathlon.sim."):
            continue
        for key, value in list(vars(module).items()):
            if isinstance(value, Dispatcher):
                setattr(module, key, value.py_func)
        replaced = {"math": MATH, "fused": lambda a, b, c: a * b + c}
        vars(module).update({key: value for key, value in replaced.items() if hasattr(module, key)})
        used = [key for key in VECTORS if getattr(module, key, None) is vectors[key]]
        vars(module).update({key: VECTORS[key] for key in used})
    vars(observation_kernel)["np"] = SimpleNamespace(float32=lambda value: value, inf=np.inf)


def count(races: World) -> tuple[Counter[str], Counter[str]]:
    """What the cars of the first race do in `STEPS` steps, and in observing after each."""
    drive = random_drive(np.random.default_rng(1))
    for _ in range(WARM_UP):
        races.step(drive(races))
    uncompile()
    p, layout = number(races.parameters), number(layout_parameters(SPEC))
    cars: Any = [number(car) for car in races.state[0]]
    notes: Any = [SimpleNamespace() for _ in races.contacts[0]]
    touched = number(np.full((CARS, CARS), -np.inf))
    race = RaceRows(cars, races.ticks[:1].copy(), touched, notes, np.zeros(1, np.int64))
    seen = SPEC.cars_ahead + SPEC.cars_behind
    stepping: Counter[str] = Counter()
    observing: Counter[str] = Counter()
    for _ in range(STEPS):
        actions, ground = number(drive(races)[0]), Ground(*number(np.empty((3, 4))))
        done.clear()
        race_step.step_race(race, actions, SUBSTEPS, ground, p)
        stepping.update(done)
        for car in range(CARS):
            values = number(np.empty(SPEC.size))
            nearby = observation_kernel.Nearby(np.empty(seen, np.int64), np.empty(seen, object))
            done.clear()
            observation_kernel.observe_car(cars, car, values, layout, nearby, p)
            observing.update(done)
    return stepping, observing


@kernel
def add_up(term: float, times: int) -> float:
    """A sum whose every addition waits for the last."""
    total = 0.0
    for _ in range(times):
        total += term
    return total


def cycle_s() -> float:
    """Time of a clock cycle, s."""
    add_up(0.5, 1)
    spans = []
    for _ in range(9):
        began = time.thread_time()
        add_up(0.5, CHAIN)
        spans.append(time.thread_time() - began)
    return min(spans) / CHAIN / ADDITION


def least_cycles(each: dict[str, float]) -> float:
    """Cycles for which the busiest unit is busy; what sines take is left out."""
    return max(
        each["multiply"] / 2.0,
        (each["add"] + each["compare"]) / 2.0,
        each["divide"] * DIVISION + each["root"] * ROOT,
    )


def main() -> None:
    """Measure, count, print."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    chosen = parser.parse_args()
    rows = []
    rng = np.random.default_rng(0)
    times = cost(CARS, random_drive(rng), rng)
    circuit, scenario = load_track(CIRCUIT), load_scenario(SCENARIOS[CARS])
    races = scenario.world(circuit, load_car(CAR), 1)
    races.reset(0, scenario.place(circuit, rng))
    races.observe(SPEC, *seats(races))
    clock = cycle_s()
    table = Table("", "add", "multiply", "divide", "root", "compare", "function", "least cycles", "cycles")
    counts = count(races)
    for name, sums, units, seconds in zip(
        ("60 Hz step of a car", "observation"), counts, (SUBSTEPS, 1), times, strict=True
    ):
        each = {kind: sums[kind] / (STEPS * CARS * units) for kind in (*sums, "root", "function")}
        kinds = ("add", "multiply", "divide", "root", "compare", "function")
        cells = [f"{each[kind]:.1f}" for kind in kinds]
        least, took = round(least_cycles(each)), round(seconds / units / clock)
        table.add_row(name, *cells, str(least), str(took))
        rows.append({"what": name, **each, "least_cycles": least, "cycles": took})
    Console(width=110).print(table)
    if chosen.json:
        write_result(chosen.json, rows)
    print(f"clock {1e-9 / clock:.2f} GHz")


if __name__ == "__main__":
    main()

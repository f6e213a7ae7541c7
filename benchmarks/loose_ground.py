"""What one policy makes of wet roads, gravel and snow that it was never trained on.

`python -m benchmarks.loose_ground --json FILE [POLICY]` takes the bundled generalist, or another checkpoint
for any pair. It drives the six generated circuits of `benchmarks.generalist`, with the three cars in turn, on
grounds that differ in grip and in the slip at which it peaks: on loose ground tyres peak later and flatter
(`nathlon.sim.tuning.loosen`). The built-in driver has practised on each of them.

`grounds` has a row for each: `grip`, `peak_slip` as a multiple of that on a dry road; `driver_ratio` and
`driver_ratio_worst`, median and greatest of the laps over the driver's, by circuit; `no_lap`, on how many
circuits half of 8 rolling starts gave none; `off_course_share` of the time, and the driver's.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track

from benchmarks.generalist import CARS, Pair, Row, number, unseen
from benchmarks.result import write_result
from benchmarks.time_trial import FLYING, TimeTrial, drive_alone
from nathlon.arena.entrant import enter
from nathlon.policies.bundled import generalist
from nathlon.policies.sources import DRIVER
from nathlon.sim.car import load_car
from nathlon.sim.car_family import write_car
from nathlon.sim.errors import InputError
from nathlon.sim.tuning import loosen


class Ground(NamedTuple):
    """Grip, as a multiple of a dry road's; the slip at its peak likewise; and shape of the tyre curve."""

    name: str
    grip: float
    peak_slip: float
    shape: float | None = None


GROUNDS = (
    Ground("dry road", 1.0, 1.0),
    Ground("damp road", 0.85, 1.0),
    Ground("wet road", 0.65, 1.0),
    Ground("wet road, later peak", 0.65, 1.4),
    Ground("gravel", 0.5, 2.0, 1.3),
    Ground("snow", 0.25, 3.0, 1.2),
)


def car_on(ground: Ground, car: str, folder: Path) -> str:
    """A car whose tyres are as on a ground; a file of the folder."""
    path = folder / f"{car}-{ground.name.replace(' ', '-')}.toml"
    if not path.exists():
        write_car(path, loosen(load_car(car), ground.peak_slip, ground.shape))
    return str(path)


def scenario_on(ground: Ground, folder: Path) -> str:
    """Two laps from a rolling start on a ground; a file of the folder."""
    path = folder / f"flying_lap-{ground.grip:g}.toml"
    surfaces = "".join(f"{name} = {ground.grip:g}\n" for name in ("tarmac", "kerb", "grass", "gravel"))
    path.write_text(f"{Path(FLYING).read_text()}\n[grip]\n{surfaces}")
    return str(path)


def drive(policy: str, pair: Pair, ground: Ground, folder: Path) -> tuple[TimeTrial, TimeTrial]:
    """Laps of a policy and of the driver who has practised there."""
    car, scenario = car_on(ground, pair.car, folder), scenario_on(ground, folder)
    driver = DRIVER if ground.grip == 1.0 else f"{DRIVER}:grip={ground.grip:g}"
    laps, others = (drive_alone(enter(source, pair.circuit, car), scenario) for source in (policy, driver))
    return laps, others


def summary(ground: Ground, driven: Sequence[tuple[TimeTrial, TimeTrial]]) -> Row:
    """Of all circuits together."""
    ratios = np.array([laps.lap_s / driver.lap_s for laps, driver in driven])
    return {
        "ground": ground.name,
        "grip": ground.grip,
        "peak_slip": ground.peak_slip,
        "driver_ratio": number(float(np.median(ratios)), 4),
        "driver_ratio_worst": number(float(ratios.max()), 4),
        "no_lap": int(np.isinf(ratios).sum()),
        "off_course_share": round(float(np.mean([laps.off_course_share for laps, _ in driven])), 5),
        "driver_off_course_share": round(float(np.mean([other.off_course_share for _, other in driven])), 5),
    }


def main() -> None:
    """Measure, and write the JSON."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.loose_ground", description="One policy on other grounds"
    )
    parser.add_argument("policy", nargs="?", help="checkpoint; default: the bundled generalist")
    parser.add_argument("--json", type=Path, required=True, help="file for the figures")
    chosen = parser.parse_args()
    policy = chosen.policy or str(generalist())
    console = Console(stderr=True)
    try:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            every = unseen(folder, None, 0)
            pairs = [every[place * len(CARS) + place % len(CARS)] for place in range(len(every) // len(CARS))]
            grounds = [
                summary(ground, [drive(policy, pair, ground, folder) for pair in pairs])
                for ground in track(GROUNDS, "Grounds", console=console)
            ]
    except InputError as error:
        parser.error(str(error))
    write_result(chosen.json, {"checkpoint": Path(policy).stem, "circuits": len(pairs), "grounds": grounds})


if __name__ == "__main__":
    main()

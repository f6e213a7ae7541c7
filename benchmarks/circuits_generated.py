"""Generated circuits beside others, and laps on them and in generated cars by the built-in driver.

`python -m benchmarks.circuits_generated` draws a sheet of circuits, counts what they are like, and lets the
driver drive some of them with each car, and generated cars on a circuit of ours. `--circuits DIR` puts real
ones of the TUM racetrack database beside them. What the driver has practised is kept, so a run that was
stopped goes on.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from benchmarks.result import write_result
from benchmarks.time_trial import STARTS, TimeTrial, drive_alone
from nathlon.arena.entrant import enter
from nathlon.sim.car import load_car
from nathlon.sim.car_check import power_w
from nathlon.sim.car_family import generate_car, write_car
from nathlon.sim.data_file import DATA
from nathlon.sim.track import BANK, CURVATURE, LEFT, RIGHT, SLOPE, Track, Z, load_track, read_track
from nathlon.sim.track.generating import generate_track, write_generated
from nathlon.sim.track.importing import import_circuit
from nathlon.sim.track.map import draw_sheet
from nathlon.sim.track.styles import STYLES

SHOWN, COUNTED = 10, 40
"""Of each style."""
DRIVEN = {"grand-prix": 4, "street": 4, "national": 4}
CARS = ("gt3", "prototype", "coupe")
CIRCUIT, DRIVEN_CARS = "lindenring", 10
"""Where generated cars drive."""
STRAIGHT_RADIUS_M, FELT_OVER_M = 400.0, 15.0
"""A bend wider than this is straight; surveyed lines are noisy, so curvature is a mean over some metres."""
SHARES = (0.1, 0.5, 0.9)


def describe(track: Track) -> dict[str, float]:
    """What a circuit is like, in numbers."""
    table = track.table
    bend = np.abs(uniform_filter1d(table[:, CURVATURE], round(FELT_OVER_M / track.spacing), mode="wrap"))
    turning = bend > 1.0 / STRAIGHT_RADIUS_M
    radius = np.quantile(1.0 / bend[turning], SHARES)
    bends = sum({"corner": 1, "chicane": 2, "straight": 0}[section.kind] for section in track.sections)
    width = table[:, LEFT] + table[:, RIGHT]
    return {
        "length_km": track.length / 1000.0,
        "bends_km": 1000.0 * bends / track.length,
        "straight_share": float((~turning).mean()),
        "longest_straight_m": _longest(~turning) * track.spacing,
        "turned_degrees_km": float(np.degrees(np.abs(table[:, CURVATURE]).sum() * track.spacing))
        * 1000.0
        / track.length,
        "radius_10_m": float(radius[0]),
        "radius_50_m": float(radius[1]),
        "radius_90_m": float(radius[2]),
        "least_radius_m": float(1.0 / bend.max()),
        "width_m": float(width.mean()),
        "relief_m": float(np.ptp(table[:, Z])),
        "steepest": float(np.abs(table[:, SLOPE]).max()),
        "bank_degrees": float(np.degrees(np.arctan(np.abs(table[:, BANK]).max()))),
    }


def _longest(mask: NDArray[np.bool_]) -> int:
    """Rows of the longest run of true values on a closed line."""
    stops = np.flatnonzero(~mask)
    return int(np.diff(np.append(stops, stops[0] + len(mask))).max()) - 1


def spread(circuits: Sequence[Track]) -> dict[str, Any]:
    """Median, tenth and ninetieth percentile of each number over some circuits."""
    described = [describe(track) for track in circuits]
    return {
        "circuits": len(circuits),
        **{
            name: [
                round(float(np.quantile([each[name] for each in described], share)), 3)
                for share in (0.5, 0.1, 0.9)
            ]
            for name in described[0]
        },
    }


def real_circuits(folder: Path) -> list[Track]:
    """The circuits of a folder of the racetrack database."""
    with tempfile.TemporaryDirectory() as name:
        return [
            read_track(import_circuit(file, f"real-{number}", Path(name)).path)
            for number, file in enumerate(sorted(folder.glob("*.csv")))
        ]


def summary(trials: Sequence[TimeTrial]) -> dict[str, Any]:
    """How laps alone went, over some circuits or cars."""
    laps = np.concatenate([trial.laps_s for trial in trials])
    off = [trial.off_course_share for trial in trials]
    return {
        "laps": len(laps),
        "finished": int(np.isfinite(laps).sum()),
        "clean": sum(trial.clean for trial in trials),
        "off_course_share": round(float(np.mean(off)), 5),
        "off_course_most": round(max(off), 5),
    }


def drive_circuits(folder: Path) -> dict[str, Any]:
    """Laps by the built-in driver on generated circuits, by style and car."""
    figures: dict[str, Any] = {}
    for style, count in DRIVEN.items():
        paths = [str(write_generated(folder, seed, style)) for seed in range(count)]
        for car in CARS:
            trials = [_driven(path, car) for path in paths]
            speeds = [
                3.6 * load_track(path).length / trial.lap_s for path, trial in zip(paths, trials, strict=True)
            ]
            figures.setdefault(style, {})[car] = {
                "circuits": count,
                **summary(trials),
                "km_h": [round(min(speeds)), round(max(speeds))],
            }
    return figures


def drive_cars(folder: Path) -> dict[str, Any]:
    """Laps by the built-in driver in generated cars."""
    trials, strength = [], []
    for seed in range(DRIVEN_CARS):
        car = generate_car(seed)
        write_car(folder / f"{car.name}.toml", car)
        strength.append(power_w(car) / car.body.mass_kg)
        trials.append(_driven(CIRCUIT, str(folder / f"{car.name}.toml")))
    laps = [trial.lap_s for trial in trials]
    return {
        "circuit": CIRCUIT,
        "cars": DRIVEN_CARS,
        **summary(trials),
        "w_kg": [round(min(strength)), round(max(strength))],
        "lap_s": [round(min(laps), 1), round(max(laps), 1)],
    }


def _driven(circuit: str, car: str) -> TimeTrial:
    trial = drive_alone(enter("driver", circuit, car))
    name = load_track(circuit).name
    print(name, load_car(car).name, f"{trial.lap_s:.1f} s, {trial.clean} of {STARTS} clean", flush=True)
    return trial


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--circuits", type=Path, metavar="DIR", help="real circuits, as CSV files")
    parser.add_argument("--sheet", type=Path, metavar="FILE", help="picture of thirty circuits")
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    options = parser.parse_args()
    if options.sheet:
        draw_sheet([generate_track(seed, style) for style in STYLES for seed in range(SHOWN)], options.sheet)
    groups = {style: [generate_track(seed, style) for seed in range(COUNTED)] for style in STYLES}
    groups["bundled"] = [load_track(path.name) for path in sorted((DATA / "circuits").iterdir())]
    if options.circuits:
        groups["real"] = real_circuits(options.circuits)
    figures: dict[str, Any] = {"spread": {name: spread(circuits) for name, circuits in groups.items()}}
    for name, those in figures["spread"].items():
        print(name, those, flush=True)
    with tempfile.TemporaryDirectory() as name:
        figures["driven"] = drive_circuits(Path(name))
        figures["cars"] = drive_cars(Path(name))
    if options.json:
        write_result(options.json, figures)


if __name__ == "__main__":
    main()

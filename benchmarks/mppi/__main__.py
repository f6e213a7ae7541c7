"""What planning around a policy brings and costs on the Lindenring, with another aim, road or car.

`OPENBLAS_NUM_THREADS=1 python -m benchmarks.mppi laps --json FILE` has the bundled champion drive laps as it
is, and planned for an objective (`mppi:CHECKPOINT?objective=...`), from the same rolling starts. The JSON has
by setting the lap time, tyres on kerbs and beyond them summed over steps of 0.1 s, time off course and at
walls, s, and wear of the tyres, each a lap; and the processor time of a decision for one car.

`python -m benchmarks.mppi traffic --json FILE` has it drive 40 s in each of 16 races of eight, among
built-in drivers, as it is and planned. The JSON has `times`, processor times of a decision where one and
where all eight cars of a race are planned for; and by setting the means of a car: way, km, the same sums,
wear; and of all measured cars together the contacts and those at their fault.

`python -m benchmarks.mppi residual --run FOLDER --json FILE` trains further, for an objective, what the last
checkpoint of a run drives (`benchmarks.mppi.residual`). The JSON has laps of that checkpoint `bare`,
`planned` and `trained`, the last after some updates, hours and laps of data. Ctrl-C stops; the same command
goes on.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from benchmarks.mppi.driven import SETTINGS, TRAFFIC, compare, decision_times, laps, traffic
from benchmarks.mppi.residual import residual
from benchmarks.result import write_result
from nathlon.sim.errors import InputError
from nathlon.terminal import say


def each_setting(measure: Any) -> dict[str, Any]:
    """A measure in all settings."""
    found = {}
    for name, setting in SETTINGS.items():
        found[name] = compare(measure, setting)
        say(f"{name}: {found[name]}")
    return found


def main() -> None:
    """Run one of the three, print the figures as JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.mppi", description=str(__doc__).partition("\n")[0])
    parser.add_argument("what", choices=("laps", "traffic", "residual"))
    parser.add_argument("--json", type=Path, metavar="FILE", required=True, help="file for the figures")
    parser.add_argument("--run", type=Path, metavar="FOLDER", help="the run that is trained further")
    asked = parser.parse_args()
    if asked.what == "laps":
        figures = each_setting(laps)
    elif asked.what == "traffic":
        times = decision_times(SETTINGS["kerbs and edges avoided"].objective)
        say(str(times))
        figures = {"races": TRAFFIC.races, "times": times, "settings": each_setting(traffic)}
    elif asked.run is None:
        raise InputError("residual: expected --run FOLDER, the run that is trained further")
    else:
        figures = residual(asked.run, asked.json.with_suffix(""))
    write_result(asked.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()

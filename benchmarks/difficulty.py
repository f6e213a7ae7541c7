"""Whether a test drive at the difficulty *match me* puts people in the middle of the field.

Scripted people of ten paces, who see 200 ms late and have a wheel with the aids, drive alone from the grid,
and then three matched races from the last place. Each race is kept as that of a person, and the next one is
matched by what has been kept: the third by two races. Tempers: races of eight built-in drivers who all have
to pass, the fastest from the back.

    python -m benchmarks.difficulty --json FILE

Figures: `drivers`, one row each: `pace` that it was told to drive, `shown` before each race, `forecast` and
`place` of each; `places` and `forecasts`, means of each race over all drivers; `after_two`, the place in the
third; `within`, drivers who came in at most one place from the middle there; `tempers`, contacts and those at
fault a race, by circuit and temper.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.result import write_result
from benchmarks.scripted_drivers import WHEEL, ScriptedDriver, Style
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.recorder import record_races
from nathlon.arena.runner import run_match
from nathlon.lab.drive.aids import AidedCar, Aids
from nathlon.lab.drive.choice import Choice, DrivePlan, Offer, plan
from nathlon.lab.drive.difficulty import Difficulty, field
from nathlon.lab.drive.heat import DrivenHeat
from nathlon.lab.drive.keeping import keep
from nathlon.policies.load import load_policy
from nathlon.policies.sources.human import Person
from nathlon.policies.temper import TEMPERS
from nathlon.selection.publish.output import OutputFolder
from nathlon.sim.car import load_car
from nathlon.sim.world import World

CIRCUIT, CAR = "lindenring", "gt3"
PACES = tuple(round(pace, 3) for pace in np.linspace(0.79, 0.97, 10).tolist())
CARS, LAPS, RACES = 8, 2, 3
MIDDLE = 0.5 * (CARS + 1)
PLACES = (("porto-sereno", "coupe"), ("lindenring", "gt3"), ("grandes-landes", "prototype"))
TEMPER_RACES = 12


def drive(made: DrivePlan, style: Style) -> DrivenHeat:
    """A planned race with a scripted person at the wheel, as fast as it can be computed."""
    choice, worlds = made.choice, list[World]()
    person = ScriptedDriver(choice.circuit, choice.car, style)
    aided, done = AidedCar(load_car(choice.car), Aids()), list[tuple[float, float]]()

    def hands(step: int) -> tuple[float, float]:
        cars = worlds[0].state[0]
        others = np.delete(cars, choice.seat - 1)
        own = cars[choice.seat - 1]
        done.append(aided.act(person.act(own, others[others["driving"]]), own))
        return done[-1]

    def look(world: World) -> None:
        worlds[:] = [world]

    policies = [*made.policies, Person(hands, choice.name)]
    recorded = record_races(made.match, policies, [0], made.names, observer=look)
    return DrivenHeat(made, np.array(done, np.float32), recorded.results, recorded.logs[0])


def matched(pace: float, folder: Path) -> dict[str, Any]:
    """A scripted person's drive alone and matched races: a row of `drivers`."""
    style, output, offer = WHEEL._replace(pace=pace), OutputFolder(folder), Offer.of([], CIRCUIT, CAR)
    row: dict[str, Any] = {"pace": pace, "shown": [], "forecast": [], "place": []}

    def race(difficulty: Difficulty, cars: int, seed: int) -> None:
        choice = Choice(
            name="scripted", circuit=CIRCUIT, car=CAR, cars=cars, seat=cars, laps=LAPS, opponents=(),
            difficulty=difficulty, seed=seed,
        )  # fmt: skip
        drawn = None
        if difficulty == "match":
            drawn = field(difficulty, choice.temper, choice.setting, output.store, choice.name)
            assert drawn.forecast is not None, "they have driven"
            row["shown"].append(round(drawn.forecast.pace, 4))
            row["forecast"].append(round(drawn.forecast.place, 2))
        driven = drive(plan(choice, offer, drawn), style)
        keep(driven, output)
        if drawn:
            own = driven.results.filter(driven.results["car"] == cars - 1).row(0, named=True)
            row["place"].append(own["place"])

    race("chosen", 1, 1)
    for number in range(RACES):
        race("match", CARS, 2 + number)
    return row


def tempers() -> dict[str, dict[str, dict[str, float]]]:
    """Contacts a race of fields of one temper, by circuit and temper."""
    counted: dict[str, dict[str, dict[str, float]]] = {}
    for circuit, car in PLACES:
        counted[circuit] = {}
        for temper in TEMPERS:
            paces = np.linspace(0.85, 0.99, CARS)
            sources = tuple(f"driver:pace={pace:.2f},temper={temper}" for pace in paces)
            seats = tuple(Seat(entrant) for entrant in range(CARS))
            races = tuple(Race(1 + seed, seats) for seed in range(TEMPER_RACES))
            match = Match("race", "tempers", "race", circuit, car, sources, sources, races)
            results = run_match(match, [load_policy(source, circuit, car) for source in sources])
            counted[circuit][temper] = {
                name: round(float(results[name].sum()) / TEMPER_RACES, 1)
                for name in ("contacts", "contacts_at_fault")
            }
    return counted


def main() -> None:
    """Print and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.difficulty", description="Matched test drives")
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    rows = []
    for pace in PACES:
        with TemporaryDirectory() as folder:
            rows.append(matched(pace, Path(folder)))
        print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    places = np.array([row["place"] for row in rows], float)
    figures = {
        "circuit": CIRCUIT,
        "car": CAR,
        "cars": CARS,
        "laps": LAPS,
        "drivers": rows,
        "middle": MIDDLE,
        "places": places.mean(axis=0).round(2).tolist(),
        "forecasts": np.mean([row["forecast"] for row in rows], axis=0).round(2).tolist(),
        "after_two": round(float(places[:, -1].mean()), 2),
        "within": int((np.abs(places[:, -1] - MIDDLE) <= 1.0).sum()),
        "tempers": tempers(),
    }
    print(json.dumps(figures, indent=1), file=sys.stderr)
    if options.json:
        write_result(options.json, figures)


if __name__ == "__main__":
    main()

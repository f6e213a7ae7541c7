"""`nathlon endurance`, `nathlon weekend` and `nathlon season`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nathlon.commands.options import AsJson, CarName, Circuit, Out, Seed, Workers
from nathlon.commands.selection import at_work
from nathlon.policies.sources import source_and_car
from nathlon.policies.sources.finding import check_given
from nathlon.terminal import new_table, print_json, print_table, say

if TYPE_CHECKING:
    import polars as pl

    from nathlon.api.events import WeekendOptions

Entrants = Annotated[
    list[str],
    typer.Argument(
        help="Entrants: checkpoints, composites with stints, driver:pace=0.95, plugin:NAME; with ?car=NAME "
        "behind it, each drives its own."
    ),
]
Laps = Annotated[int, typer.Option(min=1, max=1000, help="Laps of a race.")]
Scenario = Annotated[str, typer.Option(help="Name or path of the race's scenario.")]
NoPractice = Annotated[
    bool, typer.Option("--no-practice", help="No practice: cars without a plan stop when they need to.")
]
CLASS = ("Class", "In class")
"""Heads of columns that are shown where there are several."""
GOES_ON = "The same command goes on from here."


def endurance(
    entrants: Entrants,
    circuit: Circuit = "lindenring",
    car: CarName = "gt3",
    hours: Annotated[float, typer.Option(help="Hours until the race ends, up to 24.")] = 24.0,
    cars: Annotated[
        int | None,
        typer.Option(min=1, max=20, help="Cars, which entrants fill in turn; one each by default."),
    ] = None,
    scenario: Scenario = "endurance",
    seed: Seed = 1,
    out: Out = Path("runs/endurance"),
    as_json: AsJson = False,
) -> None:
    """Run a race by the clock, for 24 hours if you like; it goes on where it was stopped."""
    check_given(source_and_car(one)[0] for one in entrants)
    with at_work(GOES_ON):
        import nathlon

        result = nathlon.endurance(
            entrants,
            circuit=circuit,
            car=car,
            hours=hours,
            cars=cars,
            scenario=scenario,
            seed=seed,
            out=out,
            progress=not as_json,
        )
    if as_json:
        print_json(result.results.to_dicts())
        return
    _print_race(f"{hours:g} hours of {circuit}", result.results)
    say(f"Page         {result.page}")


def weekend(
    entrants: Entrants,
    circuit: Circuit = "lindenring",
    car: CarName = "gt3",
    laps: Laps = 40,
    scenario: Scenario = "weekend",
    no_practice: NoPractice = False,
    seed: Seed = 1,
    workers: Workers = None,
    out: Out = Path("runs/weekend"),
    as_json: AsJson = False,
) -> None:
    """Run practice, qualifying and a race; it goes on where it was stopped."""
    check_given(source_and_car(one)[0] for one in entrants)
    with at_work(GOES_ON):
        import nathlon

        result = nathlon.weekend(
            entrants,
            circuit=circuit,
            seed=seed,
            out=out,
            **_options(car, laps, scenario, no_practice, workers, as_json),
        )
    if as_json:
        practice = None if result.practice is None else result.practice.to_dicts()
        qualifying, results = result.qualifying.to_dicts(), result.results.to_dicts()
        print_json({"practice": practice, "qualifying": qualifying, "results": results})
        return
    grid = new_table("Qualifying", ("Entrant", "Lap s"))
    for name, lap_s in result.qualifying.select("name", "lap_s").iter_rows():
        grid.add_row(name, "no time" if lap_s is None else f"{lap_s:.3f}")
    print_table(grid)
    if result.practice is not None:
        for name, reason in result.practice.select("name", "reason").drop_nulls().iter_rows():
            say(f"{name} races without a plan from practice: {reason}")
    _print_race(f"{laps} laps of {circuit}", result.results)
    say(f"Page         {result.page}")


def season(
    entrants: Entrants,
    circuits: Annotated[str, typer.Option(metavar="NAME,NAME", help="Circuits of the weekends.")],
    car: CarName = "gt3",
    laps: Laps = 40,
    scenario: Scenario = "weekend",
    no_practice: NoPractice = False,
    seed: Seed = 1,
    workers: Workers = None,
    out: Out = Path("runs/season"),
    as_json: AsJson = False,
) -> None:
    """Run weekends on several circuits, and add their points up; it goes on where it was stopped."""
    check_given(source_and_car(one)[0] for one in entrants)
    with at_work(GOES_ON):
        import nathlon

        result = nathlon.season(
            entrants,
            circuits=circuits.split(","),
            seed=seed,
            out=out,
            **_options(car, laps, scenario, no_practice, workers, as_json),
        )
    if as_json:
        print_json(result.table.to_dicts())
        return
    several = result.table["class"].n_unique() > 1
    shown = result.table if several else result.table.drop("class")
    heads = ("Place", "Entrant", "Points", "Wins", *circuits.split(","))
    table = new_table("Season", (*(CLASS[:1] if several else ()), *heads))
    for row in shown.iter_rows():
        table.add_row(*(f"{value:g}" if isinstance(value, float) else str(value) for value in row))
    print_table(table)
    say(f"Page         {result.page}")


def _options(
    car: str, laps: int, scenario: str, no_practice: bool, workers: int | None, as_json: bool
) -> WeekendOptions:
    """What a weekend and those of a season take."""
    return {
        "car": car,
        "laps": laps,
        "scenario": scenario,
        "practice": not no_practice,
        "workers": workers,
        "progress": not as_json,
    }


def _print_race(title: str, results: pl.DataFrame) -> None:
    heads = ("Grid", "Entrant", "Laps", "Time s", "Lap s", "Stops", "Contacts", "Pen.", "Points")
    several = results["class"].n_unique() > 1
    table = new_table(title, ("Place", *(CLASS if several else ()), *heads), lean=True)

    def seconds(value: float | None) -> str:
        return "" if value is None else f"{value:.3f}"

    for row in results.iter_rows(named=True):
        table.add_row(
            str(row["place"]),
            *((row["class"], str(row["class_place"])) if several else ()),
            *(str(row["slot"]), row["name"], str(row["laps"])),
            seconds(row["race_time_s"]) or row["ending"].replace("_", " "),
            seconds(row["best_lap_s"]),
            *(str(row[count]) for count in ("stops", "contacts", "penalties")),
            f"{row['points']:g}",
        )
    print_table(table)

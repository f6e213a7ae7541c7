"""`nathlon race`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import polars as pl
from rich.box import SIMPLE
from rich.table import Table

from arena.entrant import Entrant, enter
from arena.match import Match, Race, Seat
from arena.pool import match_policies
from arena.qualifying import qualify
from arena.recorder import record_races
from arena.recording import write_recording
from arena.runner import run_match
from nathlon.commands.console import console, print_json, say
from nathlon.output import OutputFolder
from sim.errors import InputError
from sim.scenario import load_scenario


def race(
    sources: Sequence[str],
    scenario: str,
    circuit: str,
    car: str,
    seed: int,
    qualifying: bool,
    record: Path | None,
    as_json: bool = False,
) -> None:
    """Run one race, print its result, and keep it if a folder is given.

    Two entrants race as teams, on the odd and on the even places.
    """
    entrants = [enter(source, circuit, car) for source in dict.fromkeys(sources)]
    cars = load_scenario(scenario).cars
    if qualifying:
        timed = qualify(entrants, circuit, car, seed)
        entrants = [entrant for entrant, _ in timed]
        if not as_json:
            _print_qualifying(timed)
    seats = tuple(Seat(slot % len(entrants), slot % 2 if len(entrants) == 2 else -1) for slot in range(cars))
    if len(entrants) > cars:
        raise InputError(f"scenario {scenario}: {len(entrants)} entrants, expected at most {cars}")
    match = Match(
        "race",
        scenario,
        scenario,
        circuit,
        car,
        tuple(entrant.id for entrant in entrants),
        tuple(entrant.source for entrant in entrants),
        (Race(seed, seats),),
    )
    output = OutputFolder(record) if record else None
    policies_ = match_policies(match)
    results = run_match(match, policies_).sort("place")
    names = {entrant.id: entrant.name for entrant in entrants}
    if as_json:
        print_json([{"name": names[row["entrant"]], **row} for row in results.to_dicts()])
    else:
        _print_race(match, results, names)
    if output:
        [log] = record_races(match, policies_, [0], [entrant.name for entrant in entrants]).logs
        path = output.races / "race.mcap"
        write_recording(path, log)
        if not as_json:
            say(f"Recording    {path}")


def _print_qualifying(timed: Sequence[tuple[Entrant, float | None]]) -> None:
    table = Table(title="Qualifying")
    table.add_column("Entrant")
    table.add_column("Lap s", justify="right")
    for entrant, lap_s in timed:
        table.add_row(entrant.name, "no time" if lap_s is None else f"{lap_s:.3f}")
    console.print(table)


def _print_race(match: Match, results: pl.DataFrame, names: Mapping[str, str]) -> None:
    table = Table(title=f"{match.scenario} on {match.circuit}", box=SIMPLE)
    columns = ("Place", "Grid", "Entrant", "Time s", "Gap s", "Lap s", "Off s", "Contacts", "Fault", "Pen.")
    for column in columns:
        table.add_column(column, justify="left" if column == "Entrant" else "right")

    def seconds(value: float | None) -> str:
        return "" if value is None else f"{value:.3f}"

    fastest = results["race_time_s"].min()
    for row in results.iter_rows(named=True):
        gap = None if row["race_time_s"] is None else row["race_time_s"] - fastest
        table.add_row(
            str(row["place"]),
            str(row["slot"]),
            names[row["entrant"]],
            seconds(row["race_time_s"]) or row["ending"].replace("_", " "),
            seconds(gap),
            seconds(row["best_lap_s"]),
            f"{row['off_course_s']:.1f}",
            *(str(row[count]) for count in ("contacts", "contacts_at_fault", "penalties")),
        )
    console.print(table)

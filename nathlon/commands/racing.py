"""`nathlon race`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import polars as pl
from rich.box import SIMPLE
from rich.table import Table

from nathlon.arena.entrance import enter_all
from nathlon.arena.entrant import Entrant
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.qualifying import qualify
from nathlon.arena.recording import write_recording
from nathlon.commands.console import console, print_json, say, warn
from nathlon.output import OutputFolder
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario


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

    Two entrants race as teams, on the odd and on the even places. What policies print goes to standard error.
    """
    with Pool(1) as pool:
        entrants = enter_all(pool, sources, circuit, car)
        if qualifying:
            timed = qualify(pool, entrants, circuit, car, seed)
            entrants = [entrant for entrant, _ in timed]
            if not as_json:
                _print_qualifying(timed)
        match = single_race(entrants, scenario, circuit, car, seed)
        output = OutputFolder(record) if record else None
        [(_, results)] = pool.run([match])
        path = _record(pool, match, results, entrants, output) if output else None
    for line in pool.log.text.splitlines():
        warn(line)
    names = {entrant.id: entrant.name for entrant in entrants}
    if as_json:
        print_json([{"name": names[row["entrant"]], **row} for row in results.sort("place").to_dicts()])
        return
    _print_race(match, results.sort("place"), names)
    if path:
        say(f"Recording    {path}")


def single_race(entrants: Sequence[Entrant], scenario: str, circuit: str, car: str, seed: int) -> Match:
    """One race that entrants start in turn until the grid is full, two of them as teams.

    Raises:
        InputError: if there are more entrants than places.
    """
    cars = load_scenario(scenario).cars
    if len(entrants) > cars:
        raise InputError(f"scenario {scenario}: {len(entrants)} entrants, expected at most {cars}")
    seats = tuple(Seat(slot % len(entrants), slot % 2 if len(entrants) == 2 else -1) for slot in range(cars))
    ids, sources = zip(*((entrant.id, entrant.source) for entrant in entrants), strict=True)
    return Match("race", scenario, scenario, circuit, car, ids, sources, (Race(seed, seats),))


def _record(
    pool: Pool, match: Match, results: pl.DataFrame, entrants: Sequence[Entrant], output: OutputFolder
) -> Path:
    names = tuple(entrant.name for entrant in entrants)
    [(_, answer)] = pool.record([Wanted(match, (0,), names, results)])
    if isinstance(answer, InputError):
        raise answer
    path = output.races / "race.mcap"
    with output.filling():
        write_recording(path, answer[0])
    return path


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

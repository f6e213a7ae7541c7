"""`nathlon race`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nathlon.commands.options import AsJson, CarName, Circuit, LoaderName, Out, Seed
from nathlon.policies.sources.finding import check_given
from nathlon.terminal import new_table, print_json, print_table, say, warn

if TYPE_CHECKING:
    import polars as pl


def race(
    entrants: Annotated[
        list[str],
        typer.Argument(help="Entrants from pole on: checkpoints, generalist, driver:pace=0.95, plugin:NAME."),
    ],
    scenario: Annotated[
        str, typer.Option(help="Name or path of the scenario, with settings if you like: race:laps=3.")
    ] = "race",
    circuit: Circuit = "lindenring",
    car: CarName = "gt3",
    loader: LoaderName = None,
    seed: Seed = 1,
    qualifying: Annotated[
        bool, typer.Option("--qualify", help="Order the grid by a flying lap of each entrant.")
    ] = False,
    record: Annotated[bool, typer.Option("--record", help="Keep the race as OUT/race.mcap.")] = False,
    out: Out = Path("runs/race"),
    as_json: AsJson = False,
) -> None:
    """Run one race and print its result; the entrants fill the grid in turn, two of them as teams.

    What policies print goes to standard error.
    """
    from nathlon.arena.workers import need_worker, start_server
    from nathlon.sim.data_file import DATA, find_data

    check_given(entrants)
    for kind, name in (("circuit", circuit), ("car", car)):
        find_data(name, kind, DATA / f"{kind}s")
    if need_worker(entrants):
        start_server()
    import nathlon
    from nathlon.arena.stints import read
    from nathlon.sim.scenario import load_scenario

    load_scenario(scenario)

    result = nathlon.race(
        entrants,
        scenario=scenario,
        circuit=circuit,
        car=car,
        loader=loader,
        seed=seed,
        qualify=qualifying,
        record=out if record else None,
        progress=not as_json,
    )
    for line in result.printed.splitlines():
        warn(line)
    if as_json:
        rows = result.results.to_dicts()
        print_json([row | {"stints": [one._asdict() for one in read(row["stints"])]} for row in rows])
        return
    if result.qualifying is not None:
        _print_qualifying(result.qualifying)
    _print_race(f"{scenario} on {circuit}", result.results)
    if result.stints.height:
        _print_stints(result.stints)
    if result.recording:
        say(f"Recording    {result.recording}")


def _print_qualifying(timed: pl.DataFrame) -> None:
    table = new_table("Qualifying", ("Entrant", "Lap s"))
    for name, lap_s in timed.iter_rows():
        table.add_row(name, "no time" if lap_s is None else f"{lap_s:.3f}")
    print_table(table)


def _print_race(title: str, results: pl.DataFrame) -> None:
    heads = ("Place", "Grid", "Entrant", "Time s", "Gap s", "Lap s", "Off s", "Contacts", "Fault", "Pen.")
    table = new_table(title, heads, lean=True)

    def seconds(value: float | None) -> str:
        return "" if value is None else f"{value:.3f}"

    fastest = results["race_time_s"].min()
    for row in results.iter_rows(named=True):
        gap = None if row["race_time_s"] is None else row["race_time_s"] - fastest
        table.add_row(
            str(row["place"]),
            str(row["slot"]),
            row["name"],
            seconds(row["race_time_s"]) or row["ending"].replace("_", " "),
            seconds(gap),
            seconds(row["best_lap_s"]),
            f"{row['off_course_s']:.1f}",
            *(str(row[count]) for count in ("contacts", "contacts_at_fault", "penalties")),
        )
    print_table(table)


def _print_stints(stints: pl.DataFrame) -> None:
    table = new_table(
        "Stops", ("Place", "Entrant", "Stops", "Standing s", "In the lane s", "Stints"), ("Stints",)
    )
    for rows in stints.partition_by("place", maintain_order=True):
        table.add_row(
            str(rows["place"][0]),
            rows["name"][0],
            str(rows.height - 1),
            *(", ".join(f"{s:.1f}" for s in rows[taken].drop_nulls()) for taken in ("stood_s", "lane_s")),
            ", ".join(f"{laps} {compound}" for laps, compound in rows.select("laps", "compound").iter_rows()),
        )
    print_table(table)

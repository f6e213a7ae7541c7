"""`nathlon battery`: the n-athlon alone."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nathlon.commands.options import AsJson, ConfigPath, ConfigSeed, Out, Workers
from nathlon.commands.selection import say_set_aside, stoppable
from nathlon.policies.remote import on_this_machine
from nathlon.policies.sources.finding import check_given, find
from nathlon.results.ranks import written_rank
from nathlon.results.words import figure
from nathlon.sim.whole_file import check_output
from nathlon.terminal import new_table, print_json, print_table, say

if TYPE_CHECKING:
    import polars as pl

    from nathlon.selection.battery import BatteryAnswer


def battery(
    entrants: Annotated[
        list[str], typer.Argument(help="Checkpoints, folders of them, built-in drivers, plugin:NAME.")
    ],
    out: Out = Path("runs/battery"),
    config: ConfigPath = None,
    seed: ConfigSeed = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Put entrants through the n-athlon: tests of one skill each, with points.

    Exit code 0: done. 3: somebody could not be judged, as most of its runs are void.
    """
    check_given(on_this_machine(entrants))
    from nathlon.api.selection import configured, entered
    from nathlon.arena.entrance import endings_of
    from nathlon.arena.pool import Pool
    from nathlon.arena.results import VOID_ENDINGS
    from nathlon.results.voided import void_runs, voided
    from nathlon.selection.battery import run_battery
    from nathlon.selection.nightly.night import HEALTH
    from nathlon.selection.single_run import single_run
    from nathlon.terminal.progress import stage_progress, worker_count

    settings = configured(config, seed, workers=workers)
    check_output(out)
    path = out / "store.sqlite"
    with Pool(worker_count(settings.workers)) as pool:
        found = find(entrants, endings=endings_of(pool, settings.world))
        field, settings = entered(pool, found, settings)
        tested = field.newcomers
        with (
            stoppable(f"The same command goes on from {path}."),
            stage_progress(not as_json, ("battery",)) as on_match,
            single_run("battery", tested, settings, path, pool, on_match) as run,
        ):
            answer = run.with_those_there(tested, lambda those: run_battery(run, those, settings.battery))
            run.keep(answer.tables)
    set_aside = field.without(run.gone).excluded
    names = {entrant.id: entrant.name for entrant in tested}
    not_judged = voided(answer.not_judged, names)
    if as_json:
        told = [one.model_dump() for one in not_judged]
        excluded = [asdict(one) for one in set_aside]
        print_json(_as_json(answer, names) | {"not_judged": told, "excluded": excluded})
    else:
        _print(answer, names)
        if void := int(answer.results["ending"].is_in(VOID_ENDINGS).sum()):
            say(void_runs(void, answer.results.height, not_judged))
        say_set_aside(set_aside)
    if not_judged:
        raise SystemExit(HEALTH)


def _named(table: pl.DataFrame, names: dict[str, str]) -> list[dict[str, Any]]:
    return [{"name": names[row["entrant"]], **row} for row in table.iter_rows(named=True)]


def _as_json(answer: BatteryAnswer, names: dict[str, str]) -> dict[str, Any]:
    return {
        "battery": _named(answer.tables["battery"], names),
        "skills": _named(answer.tables["skills"], names),
        "marks": {test: asdict(marks) for test, marks in answer.marks.items()},
        "set_aside": answer.set_aside,
    }


def _print(answer: BatteryAnswer, names: dict[str, str]) -> None:
    ranking = new_table("N-athlon with 95 % intervals", ("Rank", "Entrant", "Points"))
    ranked = _named(answer.tables["battery"], names)
    for row in ranked:
        points = figure(row["points"], row["points_low"], row["points_high"], ".0f")
        ranking.add_row(written_rank(row["rank"], row["worst_rank"]), row["name"], points)
    print_table(ranking)

    heads = ("Test", "500 points", "1,000 points", "Best", "Mean", "Points")
    tests = new_table("Tests", heads, ("Test", "Best"))
    rows = _named(answer.tables["skills"], names)
    for test, marks in answer.marks.items():
        own = [row for row in rows if row["test"] == test]
        if not own:
            continue  # all its runs are void
        best = max(own, key=lambda row: row["points"])
        worth = [f"{mark:.2f} {best['unit']}" for mark in (marks.base, marks.reference)]
        tests.add_row(test, *worth, best["name"], figure(best["measure"]), f"{best['points']:.0f}")
    print_table(tests)
    for test, reason in answer.set_aside.items():
        say(f"Set aside: {test}: {reason}")

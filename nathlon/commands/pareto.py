"""`nathlon pareto`: the filter alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from nathlon.commands.options import AsJson, Checkpoints, ConfigPath, ConfigSeed, Out, Workers
from nathlon.commands.selection import say_set_aside, stoppable
from nathlon.policies.remote import on_this_machine
from nathlon.policies.sources.finding import check_given, find
from nathlon.results.words import SHARE, measure_head
from nathlon.sim.whole_file import check_output, whole_file
from nathlon.terminal import new_table, print_json, print_table, say

if TYPE_CHECKING:
    import polars as pl

    from nathlon.arena.entrant import Entrant
    from nathlon.selection.pareto.objective import Objective
    from nathlon.selection.run import Answer


def pareto(
    checkpoints: Checkpoints,
    out: Out = Path("runs/pareto"),
    config: ConfigPath = None,
    seed: ConfigSeed = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Keep the checkpoints that may be on the Pareto front.

    Exit code 0: done. 3: somebody could not be judged, as most of its runs are void.
    """
    check_given(on_this_machine(checkpoints))
    from nathlon.api.selection import configured, entered
    from nathlon.arena.entrance import endings_of
    from nathlon.arena.entrant import entrants_table
    from nathlon.arena.pool import Pool
    from nathlon.arena.results import VOID_ENDINGS
    from nathlon.reports.tables import as_texts
    from nathlon.results.voided import void_runs, voided
    from nathlon.selection.nightly.night import HEALTH
    from nathlon.selection.pareto import lost_remark
    from nathlon.selection.pareto.filter import run_filter
    from nathlon.selection.single_run import single_run
    from nathlon.terminal.progress import stage_progress, worker_count

    settings = configured(config, seed, workers=workers)
    check_output(out)
    path = out / "store.sqlite"
    with Pool(worker_count(settings.workers)) as pool:
        found = find(checkpoints, endings=endings_of(pool, settings.world))
        field, settings = entered(pool, found, settings)
        entrants = field.newcomers
        with (
            stoppable(f"The same command goes on from {path}."),
            stage_progress(not as_json) as on_match,
            single_run("pareto", entrants, settings, path, pool, on_match) as run,
        ):
            answer = run.with_those_there(entrants, lambda those: run_filter(run, those, settings.pareto))
            run.keep({"entrants": entrants_table(entrants), **answer.tables})
    excluded = field.without(run.gone).excluded
    table = pareto_table(entrants, answer)
    files = {"csv": out / "pareto.csv", "parquet": out / "pareto.parquet"}
    with whole_file(files["csv"]) as csv, whole_file(files["parquet"]) as parquet:
        as_texts(table).write_csv(csv)
        table.write_parquet(parquet)
    front, remark = table.filter("survives"), lost_remark(table)
    not_judged = voided(answer.not_judged, {entrant.id: entrant.name for entrant in entrants})
    if as_json:
        summary = {
            **run.stages[-1].model_dump(),
            "front": front.to_dicts(),
            "not_judged": [one.model_dump() for one in not_judged],
            "note": remark or None,
            "excluded": [asdict(one) for one in excluded],
            "files": {kind: str(path) for kind, path in files.items()},
        }
        print_json(summary)
    else:
        _print_front(front, table.height, settings.pareto.objective)
        if void := int(answer.results["ending"].is_in(VOID_ENDINGS).sum()):
            say(void_runs(void, answer.results.height, not_judged))
        if remark:
            say(remark)
        say_set_aside(excluded)
        for file in files.values():
            say(str(file))
    if not_judged:
        raise SystemExit(HEALTH)


def pareto_table(entrants: Sequence[Entrant], answer: Answer) -> pl.DataFrame:
    """PARETO with names and sources, and a column for each objective that it has not; the best first."""
    from nathlon.arena.entrant import entrants_table
    from nathlon.arena.results import PARETO

    objectives = answer.tables["objectives"].pivot("objective", index="entrant", values="value")
    own = objectives.select("entrant", *(name for name in objectives.columns if name not in PARETO))
    return (
        entrants_table(entrants)
        .select("name", "source", "entrant")
        .join(answer.tables["pareto"], on="entrant")
        .join(own, on="entrant", how="left")
        .sort("nondominated_probability", "name", descending=[True, False])
    )


def _print_front(front: pl.DataFrame, entered: int, objectives: Sequence[Objective]) -> None:
    from nathlon.selection.pareto.objective import quantity

    names = [objective.name for objective in objectives]
    title = f"Filter: {front.height} of {entered} checkpoints may be on the front"
    heads = [measure_head(objective.name, quantity(objective.measure).unit) for objective in objectives]
    shown = new_table(title, ("Entrant", *heads, "Non-dominated, %", "Races"))
    for row in front.iter_rows(named=True):
        values = [f"{100 * row[name]:.2f}" if name.endswith(SHARE) else f"{row[name]:.4g}" for name in names]
        shown.add_row(row["name"], *values, f"{100 * row['nondominated_probability']:.0f}", str(row["races"]))
    print_table(shown)

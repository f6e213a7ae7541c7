"""`nathlon pareto`: the filter alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import polars as pl
from rich.table import Table

from nathlon.arena.entrant import Entrant, entrants_table
from nathlon.arena.pool import Pool
from nathlon.arena.results import PARETO
from nathlon.commands.console import console, print_json, say, worker_count
from nathlon.commands.selection import entered, progress
from nathlon.config import Config
from nathlon.filter import run_filter
from nathlon.objective import Objective
from nathlon.reports.tables import as_texts
from nathlon.run import Answer
from nathlon.sim.whole_file import whole_file
from nathlon.single_run import single_run


def pareto_command(checkpoints: Sequence[Path], out: Path, config: Config, as_json: bool) -> None:
    """Filter checkpoints, write `pareto.csv` and `pareto.parquet`, and print the front.

    Raises:
        InputError: if a checkpoint cannot drive, or the configuration names what does not exist.
    """
    path = out / "store.sqlite"
    with Pool(worker_count(config.workers)) as pool:
        entrants, config = entered(pool, checkpoints, config)
        with (
            progress(f"The same command goes on from {path}.", as_json) as on_match,
            single_run("pareto", entrants, config, path, pool, on_match) as run,
        ):
            answer = run_filter(run, entrants, config.pareto)
            run.keep({"entrants": entrants_table(entrants), **answer.tables})
    table = pareto_table(entrants, answer)
    files = {"csv": out / "pareto.csv", "parquet": out / "pareto.parquet"}
    with whole_file(files["csv"]) as csv, whole_file(files["parquet"]) as parquet:
        as_texts(table).write_csv(csv)
        table.write_parquet(parquet)
    front = table.filter("survives")
    if as_json:
        summary = {
            **run.stages[-1].model_dump(),
            "front": front.to_dicts(),
            "files": {kind: str(path) for kind, path in files.items()},
        }
        print_json(summary)
        return
    _print_front(front, table.height, config.pareto.objective)
    for file in files.values():
        say(str(file))


def pareto_table(entrants: Sequence[Entrant], answer: Answer) -> pl.DataFrame:
    """PARETO with names and sources, and a column for each objective that it has not; the best first."""
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
    shown = Table(title=f"{front.height} of {entered} checkpoints may be on the front")
    names = [objective.name for objective in objectives]
    for column in ("Entrant", *names, "Probability", "Races"):
        shown.add_column(column, justify="left" if column == "Entrant" else "right")
    for row in front.iter_rows(named=True):
        values = [f"{row[name]:.4g}" for name in names]
        shown.add_row(row["name"], *values, f"{row['nondominated_probability']:.2f}", str(row["races"]))
    console.print(shown)

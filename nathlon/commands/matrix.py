"""`nathlon matrix`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nathlon.commands.options import AsJson, ConfigPath, ConfigSeed, LoaderName, Out, Workers, WorldName
from nathlon.commands.selection import at_work
from nathlon.terminal import new_table, print_json, print_table, say

if TYPE_CHECKING:
    from nathlon.results.matrix import MatrixReport

SHOWN = 12
"""Cells in the table; the page has them all."""


def matrix(
    policy: Annotated[str, typer.Argument(help="Checkpoint, driver or plugin to look at.")],
    baseline: Annotated[
        str | None, typer.Option(help="Policy to compare against; the world's own by default.")
    ] = None,
    out: Out = Path("runs/matrix"),
    config: ConfigPath = None,
    seed: ConfigSeed = None,
    workers: Workers = None,
    world: WorldName = None,
    loader: LoaderName = None,
    as_json: AsJson = False,
) -> None:
    """Find the settings in which a policy is worse than a baseline.

    The section matrix of the configuration has circuits, cars, tyres, scenarios, starting places and delays.

    Exit code 0: done. 3: a cell could not be judged, as most of its runs are void.
    """
    with at_work(f"The same command goes on from {out / 'store.sqlite'}."):
        import nathlon

        result = nathlon.matrix(
            policy,
            out,
            baseline=baseline,
            config=config,
            seed=seed,
            workers=workers,
            world=world,
            loader=loader,
            progress=not as_json,
        )
    report = result.report
    if as_json:
        print_json(report.model_dump(mode="json"))
    else:
        _print(report, out)
    sys.exit(report.exit_code)


def _print(report: MatrixReport, out: Path) -> None:
    from nathlon.reports.matrix_page import differences

    worst = [cell for cell in report.ordered() if cell.verdict == "worse"][:SHOWN]
    if worst:
        heads = ("Cell", "Worse by")
        table = new_table("What got worse first", heads, words=heads, lean=True)
        for cell in worst:
            table.add_row(cell.label, "; ".join(text for text, _ in differences(report, cell)))
        print_table(table)
    for sentence in report.set_aside:
        say(f"Not driven: {sentence}")
    for sentence in filter(None, (report.completion, report.void_runs, report.otherwise)):
        say(sentence)
    say(report.headline)
    say(f"Page         {out / 'index.html'}")

"""`nathlon gate`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nathlon.commands.options import (
    AsJson,
    Checkpoints,
    ConfigPath,
    ConfigSeed,
    LoaderName,
    Out,
    Workers,
    WorldName,
)
from nathlon.commands.selection import at_work
from nathlon.policies.remote import on_this_machine
from nathlon.policies.sources.finding import check_given
from nathlon.terminal import new_table, print_json, print_table, say, warn

if TYPE_CHECKING:
    from nathlon.api.gate import GateResult

HEADS = ("Measure", "Decision", "Difference", "Bounds", "May be", "Units")


def gate(
    checkpoints: Checkpoints,
    champion: Annotated[
        str, typer.Option(help="The champion that they would replace: checkpoint, driver or plugin.")
    ],
    out: Out = Path("runs/gate"),
    config: ConfigPath = None,
    seed: ConfigSeed = None,
    workers: Workers = None,
    world: WorldName = None,
    loader: LoaderName = None,
    as_json: AsJson = False,
) -> None:
    """Say whether a candidate may replace the champion, for people and for CI.

    Exit code 0: it may, being no worse by more than the margins. 1: it may not. 3: somebody could not be
    judged, as most of its runs are void. 4: the budget was too small to tell.
    """
    check_given(on_this_machine([*checkpoints, champion]))
    with at_work(f"The same command goes on from {out / 'store.sqlite'}."):
        import nathlon
        from nathlon.reports.gate import cells

        result = nathlon.gate(
            checkpoints,
            champion,
            out,
            config=config,
            seed=seed,
            workers=workers,
            world=world,
            loader=loader,
            progress=not as_json,
        )
    if as_json:
        print_json(result.report.model_dump(mode="json"))
    else:
        for candidate in result.report.candidates:
            title = f"{candidate.name} against {result.report.champion}"
            table = new_table(title, HEADS, HEADS[:2], lean=True)
            for finding in candidate.findings:
                table.add_row(*cells(finding))
            print_table(table)
            for note in candidate.notes:
                say(note)
        say(result.report.headline)
        for remark in result.report.remarks:
            say(remark)
        say(f"Page         {out / 'index.html'}")
    if config is not None:
        _promote(result, config)
    sys.exit(result.report.exit_code)


def _promote(result: GateResult, config: Path) -> None:
    """Have the registry that the configuration names say who is champion now; standard error says it."""
    from nathlon.selection.config import read_config

    settings = read_config(config)
    if settings.results.mlflow is None:
        return
    from nathlon.lab.sinks.telling import tell_gate

    for one in tell_gate(result.report, result.sources, settings):
        warn(f"Champion     {one.place or one.sentence.strip()}")

"""One selection of given checkpoints, in a folder of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from nathlon.arena.entrance import enter_all
from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.results.selection import Selection
from nathlon.results.summary import Summary
from nathlon.selection.config import Config
from nathlon.selection.field import EntryList
from nathlon.selection.pipeline import run_pipeline
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.publish.publish import publish
from nathlon.selection.publish.recordings import record_tournament
from nathlon.selection.publish.sent import keep_sent
from nathlon.selection.run import WAITING, OnMatch
from nathlon.selection.single_run import single_run

OnVerdict = Callable[[Summary], None]
"""Told what a selection came to as soon as the committee has decided, before anything is published."""


def single_selection(
    field: EntryList,
    output: OutputFolder,
    config: Config,
    pool: Pool,
    on_match: OnMatch,
    on_verdict: OnVerdict | None = None,
) -> Selection | None:
    """Run the whole selection, hand its verdict out, then leave its report and recordings.

    One that was stopped goes on from what its store holds: after the verdict, with report and recordings.

    Args:
        field: the candidates, all of one circuit and car, and what is set aside.
        output: where everything goes.
        config: how to select, with the circuit and the car of the entrants.
        pool: where policies run.
        on_match: told about progress.
        on_verdict: told what it came to.

    Returns:
        what the report shows; None where people must vote first.
    """
    with single_run("selection", field.newcomers, config, output.store, pool, on_match, output.root) as run:
        verdict = run_pipeline(run, replace(field, anchors=_references(config, pool)), config)
        if verdict is None:
            run.status = WAITING
            return None
        # At once: what is kept can be sent whatever becomes of the file.
        kept = verdict.model_copy(update={"sent": keep_sent(run.store, run.name, output)})
        if on_verdict is not None:
            on_verdict(kept)
        selection = publish(run.store, run.name, output, run.pool, on_match)
        if config.recordings == "all":
            record_tournament(run.store, run.name, output, run.engine, on_match)
        return selection


def _references(config: Config, pool: Pool) -> tuple[Entrant, ...]:
    """The references of a gauntlet; without any, candidates race each other alone."""
    if not config.in_gauntlet:
        return ()
    return tuple(enter_all(pool, config.nightly.anchors, config.circuit, config.car, config.world))

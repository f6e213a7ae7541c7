"""The report of a run as it stands now, with the recordings that its folder has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from nathlon.arena.store import Store
from nathlon.reports.page import render
from nathlon.results.summary import Replay, read_summary
from nathlon.selection.publish.gathering import gather
from nathlon.selection.publish.output import POLICY_LOG, SUMMARY
from nathlon.selection.publish.replays import kept_replays
from nathlon.sim.errors import InputError


def live_report(store: str, run: str, folder: Path | None) -> str:
    """The page of a run's report, made from the store alone: nothing is run, and nothing written.

    Args:
        store: path or URL.
        run: its name.
        folder: of the run; None where it has none yet.

    Raises:
        InputError: if the store cannot be read.
    """
    with Store.open(store) as opened:
        selection = gather(opened, run)
    if folder is not None:
        try:
            replays = kept_replays(read_summary(folder / SUMMARY), selection.results, folder)
        except InputError:
            return render(selection)
        log = f"../{POLICY_LOG}" if (folder / POLICY_LOG).exists() else None
        summary = selection.summary.model_copy(update=replays.facts | {"log": log})
        selection = replace(selection, summary=summary, logs=replays.logs)
    return render(selection)


def races_to_look_at(folder: Path | None) -> tuple[Replay, ...]:
    """Those of the report in a run's folder."""
    if folder is None or not (folder / SUMMARY).is_file():
        return ()
    try:
        return read_summary(folder / SUMMARY).replays
    except InputError:
        return ()

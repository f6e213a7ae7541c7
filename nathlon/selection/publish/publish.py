"""From a run in the store to the folder that people look at."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import polars as pl

from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.reports.page import PAGE, write_page
from nathlon.reports.spreadsheet import write_spreadsheet
from nathlon.reports.tables import write_tables
from nathlon.results.selection import Selection
from nathlon.results.summary import write_summary
from nathlon.selection.publish.curves import keep_curves
from nathlon.selection.publish.decider import DRIVEN
from nathlon.selection.publish.films import record_films
from nathlon.selection.publish.gathering import gather
from nathlon.selection.publish.laps import keep_laps
from nathlon.selection.publish.output import POLICY_LOG, REPORT, SUMMARY, OutputFolder
from nathlon.selection.publish.replays import record_replays
from nathlon.selection.publish.sent import keep_sent
from nathlon.selection.run import OnMatch
from nathlon.sim.errors import InputError


def publish(store: Store, run: str, output: OutputFolder, pool: Pool, on_match: OnMatch) -> Selection:
    """Write page, spreadsheet, tables and summary, and have the pool record what is to be looked at.

    Of a run that has not come to its end, all is written as far as it has come. Races whose recordings are
    there are not run again. A store that cannot be written gives the laps and curves that it holds.
    """
    if not store.read_only:
        keep_laps(store, run, pool)
        keep_curves(store, run)
    selection = gather(store, run)
    selection = replace(selection, store=output.named(selection.store))
    facts: dict[str, Any] = {"report": f"{REPORT}/{PAGE}"}
    with suppress(InputError):  # of a run that ended long ago the files may be gone
        facts["sent"] = keep_sent(store, run, output)
    with output.filling():
        if selection.summary.circuit:
            races = selection.results.filter(pl.col("stage").is_in(("tournament", DRIVEN)))
            replays = record_replays(store, races, selection.tables, output, pool)
        else:
            replays = record_films(
                store, selection.results, selection.tables, selection.summary.episode, output, pool, on_match
            )
        log = f"../{POLICY_LOG}" if (output.root / POLICY_LOG).exists() else None
        summary = selection.summary.model_copy(update=replays.facts | facts | {"log": log})
        selection = replace(selection, summary=summary, logs=replays.logs)
        write_page(selection, output.report)
        write_spreadsheet(selection, output.report / "ranking.xlsx")
        write_tables(selection, output.report / "tables")
        write_summary(output.root / SUMMARY, summary)
    return selection

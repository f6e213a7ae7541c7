"""From a run in the store to the folder that people look at."""

from __future__ import annotations

from typing import Any

from arena.results import TABLES
from arena.store import Store
from nathlon.committee import Minutes, describe
from nathlon.decider import record_decider
from nathlon.output import OutputFolder
from reports.page import write_page
from reports.selection import Selection
from reports.spreadsheet import write_spreadsheet
from sim.errors import InputError


def publish(store: Store, run: str, output: OutputFolder) -> Selection:
    """Write page, spreadsheet, summary and the replay of the deciding race.

    Raises:
        InputError: if the run has not come to its end.
    """
    tables = {name: store.table(run, name) for name in TABLES}
    summary: Any = store.facts(run).get("summary")
    if summary is None:
        raise InputError(f"{store.name}: run {run} has not come to its end, expected one with a summary")
    results = store.results_of_run(run)
    summary = summary | record_decider(store, store.results_of_run(run, "tournament"), tables, output)
    summary["committee"] = [describe(decision) for decision in Minutes(store, run).decisions().values()]
    selection = Selection("nathlon: policy selection", tables, results, summary)
    write_page(selection, output.report)
    write_spreadsheet(selection, output.report / "ranking.xlsx")
    output.write_summary(summary)
    return selection

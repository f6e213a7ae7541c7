"""How the incidents of a folder have gone in the runs before."""

from __future__ import annotations

from typing import Any

import polars as pl

from nathlon.arena.store import Store
from nathlon.results.selection import INCIDENT_HISTORY
from nathlon.results.summary import Summary


def incident_history(store: Store, run: str) -> pl.DataFrame:
    """INCIDENT_HISTORY of the runs of a store before one, oldest first, of the tests that this one holds."""
    tests = store.table(run, "incidents")["test"].unique().to_list()
    rows: list[dict[str, Any]] = []
    for record in store.runs():
        if record.name == run:
            break
        held = store.table(record.name, "incidents").filter(pl.col("test").is_in(tests))
        kept: Any = store.facts(record.name).get("summary")
        sent = [one.entrant for one in Summary.model_validate(kept).sent] if kept else []
        for (test,), own in held.group_by("test", maintain_order=True):
            of_sent = own.filter(pl.col("entrant").is_in(sent))["passed"].to_list()
            rows.append(
                {
                    "run": record.name,
                    "test": test,
                    "entrants": own.height,
                    "passed": int(own["passed"].sum()),
                    "sent_passed": of_sent[0] if of_sent else None,
                }
            )
    return pl.DataFrame(rows, schema=INCIDENT_HISTORY)

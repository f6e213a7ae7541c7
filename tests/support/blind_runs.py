"""A run whose committee is asked whom to send, for the tests of blind drives."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import polars as pl

from nathlon.arena.entrant import Entrant, enter, entrants_table
from nathlon.arena.results import RANKING
from nathlon.arena.store import Store
from nathlon.selection.committee import ask
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.rules import CommitteeSettings
from tests.support.checkpoints import BUNDLED
from tests.support.race_results import rows
from tests.support.selections import ranked

NAMES = ("amber", "birch", "cedar")
RUN = "night"


def blind_run(folder: Path, names: Sequence[str] = NAMES) -> list[Entrant]:
    """Leave a run in a folder, with finalists and a question that waits for people."""
    finalists = []
    for name, file in zip(names, BUNDLED, strict=False):
        (folder / "weights").mkdir(parents=True, exist_ok=True)
        copy = shutil.copy(file, folder / "weights" / f"{name}.safetensors")
        finalists.append(replace(enter(str(copy), "lindenring", "gt3"), name=name))
    ranking = pl.DataFrame(
        [ranked(one.id, rank, 20.0 - rank) for rank, one in enumerate(finalists, 1)], schema=RANKING
    )
    results = rows({"entrant": [one.id for one in finalists], "race": range(len(names))}, len(names))
    with Store(folder / "store.sqlite") as store:
        store.begin_run(RUN, {})
        store.put_table(RUN, "entrants", entrants_table(finalists))
        settings = CommitteeSettings(members=("ann", "bob", "cy"), quorum=1)
        ask(EventLog(store, RUN), "selection", finalists, {"ranking": ranking}, results, settings)
    return finalists

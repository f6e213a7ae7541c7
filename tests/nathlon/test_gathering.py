"""How far a report says that a run has come."""

from __future__ import annotations

from pathlib import Path

from nathlon.arena.store import Store
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.publish.gathering import gather
from tests.support.committees import PEOPLE, ask


def test_a_run_that_has_ended_is_not_under_way(tmp_path: Path) -> None:
    """A test drive selects nobody; a night may be given up."""
    with Store(tmp_path / "store.sqlite") as store:
        store.begin_run("night", {})
        assert gather(store, "night").under_way == "under way: filter, 0 of 0 matches"
        store.put_fact("night", "progress", {"stage": "battery", "done": 7, "total": 1200})
        assert gather(store, "night").under_way == "under way: n-athlon, 7 of 1,200 matches"
        store.end_run("night", "done")
        assert gather(store, "night").under_way == "ended without a selection"
        store.end_run("night", "abandoned")
        assert gather(store, "night").under_way == "abandoned"
        ask(EventLog(store, "night"), PEOPLE)
        assert gather(store, "night").under_way == "the committee is asked about the shortlist"

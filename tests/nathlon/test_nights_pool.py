"""The pool over the nights: what is kept from night to night gives what all the races would."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from nathlon.arena.entrant import Entrant
from nathlon.arena.store import RunRecord, Store
from nathlon.selection.field import EntryList
from nathlon.selection.nightly import pool as nights_pool
from nathlon.selection.nightly.pool import best_first, rank_nights
from nathlon.selection.run import CONFIDENCE
from nathlon.tournament.evidence import Cells, Evidence
from nathlon.tournament.points import rank
from nathlon.tournament.stopping import repeated
from tests.support.race_results import tournament

EXACT = ["entrant", "rank", "points_per_race", "pairs", "races", "faults", "contacts_per_km"]
ANCHOR = "driver"
FIELDS = [("n1", "n2"), ("n3", "n1"), ("n4", "n5"), ("n6", "n1")]
PACE = {ANCHOR: 0.0, "n1": 1.5, "n2": 0.3, "n3": 0.5, "n4": -0.5, "n5": 0.6, "n6": 1.4}


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store(tmp_path / "store.sqlite") as store:
        yield store


def race(store: Store, number: int) -> RunRecord:
    """A night, as one finds it before its pool is ranked."""
    names = (ANCHOR, *FIELDS[number])
    entrants = [Entrant(name, name, name, "QR-SAC", "lindenring", "gt3", 1, 1) for name in names]
    field = EntryList(tuple(entrants[1:]), anchors=(entrants[0],))
    name = f"night-{number + 1:04d}"
    record = store.begin_run(name, {"world": {"config": "a", "code": "b"}, "field": asdict(field)})
    pace = {each: PACE[each] for each in names}
    results = tournament(pace, 4, np.random.default_rng(number))
    results = results.with_columns(pl.col("match") + f" on {name}")
    for (key,), rows in results.partition_by("match", as_dict=True).items():
        store.add_match(str(key), "tournament", {}, rows)
        store.use(name, [str(key)])
    store.end_run(name, "done")
    return record


def raced(store: Store) -> pl.DataFrame:
    return pl.concat([store.results_of_run(night.name, "tournament") for night in store.runs()])


@pytest.fixture
def by_students_t(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ranks of all races without regard to skewness, which a pool does not keep."""
    monkeypatch.setattr(Evidence, "p_values", Cells.p_values)


@pytest.mark.usefixtures("by_students_t")
def test_the_pool_is_the_ranking_of_all_races(store: Store) -> None:
    """Each night but the second keeps its tally; the third makes up for the second."""
    for number in range(len(FIELDS)):
        night = race(store, number)
        made = rank_nights(store, store.runs(), night, 3)
        confidence = repeated(CONFIDENCE, number + 1)
        expected = rank(raced(store), np.random.default_rng(0), confidence=confidence)
        assert_frame_equal(made["pool"][EXACT], expected[EXACT])
        if number != 1:
            for name, table in made.items():
                store.put_table(night.name, name, table)
    assert made["pool"]["rank"].n_unique() > 1


@pytest.mark.usefixtures("by_students_t")
def test_a_night_that_is_ranked_again_is_not_counted_twice(store: Store) -> None:
    first, second = race(store, 0), race(store, 1)
    for night in (first, second, second):
        made = rank_nights(store, store.runs(), night, 3)
        for name, table in made.items():
            store.put_table(night.name, name, table)
    expected = rank(raced(store), np.random.default_rng(0), confidence=repeated(CONFIDENCE, 2))
    assert_frame_equal(made["pool"][EXACT], expected[EXACT])


def test_only_the_best_and_the_anchors_are_kept(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nights_pool, "KEPT", 2)
    for number in range(len(FIELDS)):
        night = race(store, number)
        made = rank_nights(store, store.runs(), night, 1)
        kept = set(made["pool_totals"]["entrant"])
        assert kept == {*best_first(made["pool"])[:2], ANCHOR}
        assert set(made["pool_cells"]["entrant"]) <= kept
        for name, table in made.items():
            store.put_table(night.name, name, table)


def test_nights_in_another_world_do_not_count(store: Store) -> None:
    first = race(store, 0)
    other = store.begin_run(
        "night-0009", {"world": {"config": "c", "code": "b"}, "field": first.config["field"]}
    )
    made = rank_nights(store, store.runs(), other, 3)
    assert all(table.is_empty() for table in made.values())

"""A clock that is put back or forward while processes share a store."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path

import pytest

from nathlon.arena.claimant import owner_name
from nathlon.arena.entrant import enter
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.arena.store.claims import LONGEST_S
from nathlon.selection.run import Run
from nathlon.selection.trials import against
from tests.support.clocks import Clock

DAY, YEAR = timedelta(days=1), timedelta(days=365)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store(tmp_path / "store.sqlite") as store:
        yield store


def test_a_claim_from_before_the_clock_was_put_back_does_not_last_for_days(
    store: Store, clock: Clock
) -> None:
    assert store.claim(["a"], "dead", LONGEST_S) == ["a"]
    clock.ahead -= DAY
    assert store.claim(["a"], "one", LONGEST_S) == [], "its owner may well be alive"
    clock.ahead += timedelta(seconds=LONGEST_S + 1)
    assert store.claim(["a"], "one", LONGEST_S) == ["a"]


def test_a_clock_that_goes_on_by_a_year_and_back_leaves_nothing_claimed_for_a_year(
    store: Store, clock: Clock
) -> None:
    clock.ahead += YEAR
    assert store.claim(["a", "b"], "one", LONGEST_S) == ["a", "b"]
    clock.ahead -= YEAR
    assert store.claim(["a", "b"], "two", LONGEST_S) == []
    clock.ahead += timedelta(seconds=LONGEST_S / 2)
    assert store.claim(["a"], "one", LONGEST_S) == ["a"], "an owner renews whatever the clock says"
    clock.ahead += timedelta(seconds=LONGEST_S / 2 + 1)
    assert store.claim(["a", "b"], "two", LONGEST_S) == ["b"]


def test_runs_stay_in_order_and_never_end_before_they_began(store: Store, clock: Clock) -> None:
    store.begin_run("first", {})
    clock.ahead -= DAY
    store.end_run("first", "done")
    store.begin_run("second", {})
    store.append("said", {"n": 1})
    clock.ahead -= DAY
    store.append("said", {"n": 2})
    store.end_run("second", "done")
    first, second = store.runs()
    assert (first.name, second.name) == ("first", "second")
    assert second.began_at < first.began_at
    for run in (first, second):
        assert run.ended_at is not None
        assert run.ended_at >= run.began_at
    assert [entry.entry["n"] for entry in store.log()] == [1, 2]


def test_a_match_of_one_who_dies_while_others_wait_for_it_is_run_at_once(store: Store) -> None:
    match = against("battery", "duel", "slipstream_pass", enter("driver", "lindenring", "gt3"),
                    ["driver:pace=0.9"], [1], range(1))  # fmt: skip
    store.begin_run("night", {})
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as other, Pool(1) as pool:
        assert store.claim([match.key], owner_name(other.pid), LONGEST_S) == [match.key]
        run = Run(store, "night", (1,), pool, lambda *_: None)
        with ThreadPoolExecutor(1) as threads:
            waiting = threads.submit(run.results, "battery", [match])
            with pytest.raises(TimeoutError):
                waiting.result(timeout=2.0)
            other.kill()
            other.wait()
            # Long before the claim runs out.
            results = waiting.result(timeout=LONGEST_S / 3)
    assert results.height == 2
    assert store.owners() == []

"""Matches that are wanted on one machine and run on others: what travels, who takes what, what goes wrong."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl
import pytest
import sqlalchemy as sa
from hypothesis import given
from hypothesis import strategies as st

from nathlon.api import worker
from nathlon.arena.claimant import Claimant, at_work, owner_name
from nathlon.arena.control import KIND, control, steer
from nathlon.arena.engine import LocalEngine, plenty, share
from nathlon.arena.entrant import enter
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.payload import labels
from nathlon.arena.pool import Pool
from nathlon.arena.processor import processor
from nathlon.arena.queue import Taker, post
from nathlon.arena.queue_engine import QueueEngine
from nathlon.arena.queue_entry import digest_of
from nathlon.arena.queue_worker import Shift, work
from nathlon.arena.store import Queued, Store
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds import episodes
from nathlon.selection.trials import against
from tests.support.checkpoints import BUNDLED
from tests.support.clocks import Clock
from tests.support.games import player, refused, world_of

if TYPE_CHECKING:
    from tests.support.databases import Server

pytest_plugins = ["tests.support.databases"]

SLOW = """PettingZooWorld(
    {"duel": envs["duel"]}, score=lambda seat: (__import__("time").sleep(0.02), seat.total)[1]
)"""
"""Episodes of 0.04 s."""
DUELS = 'PettingZooWorld({"duel": envs["duel"]}, measures={"hits": Declared("hits")})'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("games")


@pytest.fixture(scope="module")
def world(folder: Path) -> str:
    return world_of(folder, DUELS)


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(1) as pool:
        yield pool


def duels(world: str, folder: Path, count: int = 3) -> list[Match]:
    """Matches of two seeds each between a good and a bad player, whose files are in the folder."""
    folder.mkdir(exist_ok=True)
    sources = tuple(player(folder / f"{right}.onnx", right) for right in (3, 1))
    entrants = tuple(load_world(world).enter(source).id for source in sources)
    seats = (Seat(0, 0), Seat(1, 1))
    return [
        Match(
            "pareto", f"duel-{number}", "duel", "", "", entrants, sources,
            (Race(2 * number, seats), Race(2 * number + 1, seats)), world,
        )
        for number in range(count)
    ]  # fmt: skip


def results_of(matches: list[Match], pool: Pool) -> pl.DataFrame:
    """RESULTS of matches as a pool gives them without a store."""
    found = {match.key: frame for match, frame in pool.run(matches)}
    return pl.concat([found[match.key] for match in matches])


def work_through(store: Store, pool: Pool, world: str) -> Shift:
    return work(store, pool, [world], wait_s=0.0)


def test_a_worker_has_the_results_of_the_machine_that_wants_them(
    target: str, world: str, tmp_path: Path, pool: Pool
) -> None:
    matches = duels(world, tmp_path / "here")
    expected = results_of(matches, pool)
    with Store(target) as store:
        post(store, matches)
        if store.shared:
            shutil.rmtree(tmp_path / "here")  # the worker's machine has no such folder
        assert work_through(store, pool, world) == Shift(3, 0)
        assert store.results_of(match.key for match in matches).equals(expected)
        assert store.waiting() == {}
        assert store.owners() == []
        assert store.verify() == []


def test_who_wants_matches_and_who_helps_run_each_once(target: str, folder: Path, tmp_path: Path) -> None:
    world = world_of(folder, SLOW, "slow.py")
    matches = duels(world, tmp_path / "here", 60)
    with Store(target) as store, Pool(1) as pool, Pool(1) as other, ThreadPoolExecutor(1) as threads:
        post(store, matches)
        helping = threads.submit(work, store, other, [world], wait_s=1.0)
        while not store.stored(match.key for match in matches):
            time.sleep(0.02)
        ended = list(QueueEngine(store, pool).run(matches))
        helped = helping.result(60)
        assert sorted(key for key, _ in ended) == sorted(match.key for match in matches)
        assert helped.matches >= 1
        assert sum(here for _, here in ended) == 60 - helped.matches >= 1
        assert store.verify() == []


def test_ten_who_take_at_once_take_each_match_once(target: str, world: str, tmp_path: Path) -> None:
    matches = duels(world, tmp_path / "here", 100)
    with Store(target) as store:
        [digest] = post(store, matches)

    def take(number: int) -> list[str]:
        taken: list[str] = []
        with Store(target) as store:
            while some := store.take(digest, f"owner {number}", 3, 60):
                taken += [each.match for each in some]
        return taken

    with ThreadPoolExecutor(10) as threads:
        taken = [key for keys in threads.map(take, range(10)) for key in keys]
    assert sorted(taken) == sorted(match.key for match in matches)


def test_a_worker_that_is_killed_leaves_its_matches_to_others(
    postgres: str, folder: Path, tmp_path: Path, pool: Pool
) -> None:
    world = world_of(folder, SLOW, "slow.py")
    matches = duels(world, tmp_path / "here", 20)
    with Store(postgres) as store:
        [digest] = post(store, matches)
        command = [
            sys.executable,
            "-m",
            "nathlon.cli",
            "worker",
            postgres,
            "--world",
            world,
            "--workers",
            "1",
        ]
        with subprocess.Popen(command) as killed:
            while not store.stored(match.key for match in matches):
                time.sleep(0.02)
            killed.kill()
        # And one on another machine, which is not known to be gone until its lease ends.
        store.take(digest, "another machine", 2, 1.0)
        before = len(store.stored(match.key for match in matches))
        assert work_through(store, pool, world) == Shift(20 - before, 0)
        assert store.results_of(match.key for match in matches).equals(results_of(matches, pool))
        assert store.owners() == []


def test_a_server_that_goes_away_for_seconds_loses_nothing(
    server: Server, postgres: str, folder: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = world_of(folder, SLOW, "slow.py")
    matches = duels(world, tmp_path / "here", 40)
    with Store(postgres) as store, Pool(1) as pool, ThreadPoolExecutor(1) as threads:
        ended = threads.submit(lambda: list(QueueEngine(store, pool).run(matches)))
        while not ended.done() and len(store.stored(match.key for match in matches)) < 5:
            time.sleep(0.02)
        server.stop()
        time.sleep(2.0)
        server.start()
        assert sorted(key for key, _ in ended.result(60)) == sorted(match.key for match in matches)
        assert store.verify() == []
        assert store.results_of(match.key for match in matches).height == 160
    assert "trying again" in caplog.text


def test_a_checkpoint_that_is_not_what_it_is_named_after_stays_out(
    postgres: str, world: str, tmp_path: Path, pool: Pool, caplog: pytest.LogCaptureFixture
) -> None:
    matches = duels(world, tmp_path / "here")
    with Store(postgres) as store:
        post(store, matches)
        statement = sa.text("UPDATE file SET content = 'other' WHERE digest = :digest")
        change(postgres, statement, digest=matches[0].entrants[1])
        assert work_through(store, pool, world) == Shift(0, 3)
        assert f"checkpoint {matches[0].entrants[1][:12]} has the contents of" in caplog.text
        assert store.owners() == []
        # Where it is wanted its file is the right one.
        assert sum(here for _, here in QueueEngine(store, pool).run(matches)) == 3


RACE: dict[str, Any] = {
    "seed": 1,
    "seats": [{"entrant": 0, "team": 0}, {"entrant": 1, "team": 1}],
    "mirrored": False,
}
NO_MATCHES: list[tuple[dict[str, Any], str]] = [
    ({"races": []}, "races is []"),
    ({"races": [RACE | {"seed": 2**70}]}, "races.0.seed is 1180591620717411303424"),
    ({"races": [RACE | {"seed": -1}]}, "races.0.seed is -1"),
    (
        {"races": [RACE | {"seats": [{"entrant": 99, "team": 0}, {"entrant": 1, "team": 1}]}]},
        "is entrant 99's, expected one of 2",
    ),
    ({"races": [RACE | {"seats": RACE["seats"] * 2}]}, "a race of 4 seats, expected 2"),
    ({"races": [RACE | {"seats": "none"}]}, "races.0.seats is 'none'"),
    ({"entrants": ["random"] * 3}, "2 sources, expected one for each of 3 entrants"),
    ({"entrants": 7}, "entrants is 7"),
]


def test_entries_of_the_queue_that_are_no_matches_are_set_aside(
    target: str, world: str, tmp_path: Path, pool: Pool, caplog: pytest.LogCaptureFixture
) -> None:
    """Those that are damaged, and those that somebody has put there with the key that they hash to."""
    matches = duels(world, tmp_path / "here", len(NO_MATCHES) + 5)
    with Store(target) as store:
        [digest] = post(store, matches)
        facts, entries = store.surroundings(digest), store.take(digest, "who looks", 100, 60.0)
        store.release("who looks")
        for (wrong, _), entry in zip(NO_MATCHES, entries, strict=False):
            spec = entry.spec | wrong
            change_entry(target, entry.match, "spec", json.dumps(spec))
            change_entry(target, entry.match, "match", digest_of(facts | spec))
        first, second, third, fourth, last = (entry.match for entry in entries[len(NO_MATCHES) :])
        change_entry(target, first, "spec", json.dumps(entries[0].spec))
        change_entry(target, second, "spec", "7")
        change_entry(target, third, "spec", "{")
        change_entry(target, fourth, "sources", "[7, []]")
        assert work_through(store, pool, world) == Shift(1, 0, len(NO_MATCHES) + 4)
        said = [record.getMessage() for record in caplog.records]
        assert len(said) == len(NO_MATCHES) + 4
        for _, words in NO_MATCHES:
            assert sum(words in line for line in said) == 1
        assert sum("damaged, expected what its key names" in line for line in said) == 3
        assert store.waiting() == {}
        assert store.stored(match.key for match in matches) == {last}
        # Who wants them puts them there again.
        assert len(list(QueueEngine(store, pool).run(matches))) == len(matches)
        assert store.verify() == []


def test_a_selection_mends_its_entries_and_heeds_no_one_elses(
    target: str, world: str, tmp_path: Path, pool: Pool
) -> None:
    matches = duels(world, tmp_path / "here", 4)
    with Store(target) as store:
        [digest] = post(store, matches)
        store.enqueue([Queued("no key", digest, {}, [])], {"other": {}, digest: {}})
        change_entry(target, matches[0].key, "surroundings", "other")
        change_entry(target, matches[1].key, "spec", "{}")
        ended = list(QueueEngine(store, pool).run(matches[:2]))
        assert sorted(each.key for each in ended) == sorted(match.key for match in matches[:2])


def change_entry(target: str, match: str, column: str, value: str) -> None:
    change(
        target, sa.text(f"UPDATE queue SET {column} = :value WHERE match = :match"), value=value, match=match
    )


def test_surroundings_that_are_none_are_set_aside(
    target: str, world: str, tmp_path: Path, pool: Pool, caplog: pytest.LogCaptureFixture
) -> None:
    """Also those that hash to their digest: `{}`. They come first, and what comes after them is raced."""
    matches = duels(world, tmp_path / "here", 2)
    wrong = [{"n": number} for number in range(3)] + [{}]
    with Store(target) as store:
        for facts in wrong:
            digest = digest_of(facts)
            store.enqueue([Queued(f"of {digest}", digest, {}, [])], {digest: facts})
        for facts, text in zip(wrong, ["[]", '{"world": 7}', "{"], strict=False):
            statement = sa.text("UPDATE surroundings SET facts = :facts WHERE digest = :digest")
            change(target, statement, facts=text, digest=digest_of(facts))
        post(store, matches)
        assert work_through(store, pool, world) == Shift(2, 0, 4)
        assert sum("surroundings" in record.getMessage() for record in caplog.records) == 4
        assert store.waiting() == {}
        # Whoever wants them puts them there again.
        store.enqueue([Queued("key", digest_of({"n": 0}), {}, [])], {digest_of({"n": 0}): {"n": 0}})
        assert store.surroundings(digest_of({"n": 0})) == {"n": 0}


def test_what_a_killed_process_of_this_machine_had_is_taken_at_once(
    target: str, world: str, tmp_path: Path, pool: Pool
) -> None:
    """Also while its parent has not asked after it."""
    matches = duels(world, tmp_path / "here")
    dead = os.fork()
    if not dead:
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitid(os.P_PID, dead, os.WEXITED | os.WNOWAIT)
    try:
        with Store(target) as store, Claimant(store, pool, 60.0) as claimant:
            [digest] = post(store, matches)
            store.take(digest, owner_name(dead), 3, 60.0)
            store.attend(owner_name(dead), 2, 60.0)
            assert [each.process for each in at_work(store)] == [os.getpid()]
            taker = Taker(store, claimant, {digest}.__contains__, {}, {})
            assert taker(1) == []
            assert store.waiting(unclaimed=True) == {digest: 3}
    finally:
        os.waitpid(dead, 0)


def test_a_worker_waits_for_its_store(
    world: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What it says before it ends tells what it is at."""
    target = tmp_path / "later" / "nathlon.sqlite"

    def make(seconds: float) -> None:
        with Store(target) as store:
            post(store, duels(world, tmp_path / "here"))

    monkeypatch.setattr(worker, "sleep", make)
    with refused("no such store"):
        worker.work(str(target), workers=1, worlds=[world], wait_s=-1.0)
    assert worker.work(str(target), workers=1, worlds=[world], wait_s=0.1) == Shift(3, 0)
    said = capsys.readouterr().err.splitlines()
    assert said[0] == f"{target}: no such store yet; waiting for it for 0.1 s"
    assert said[1] == f"{target}: at work with 1 process"


def test_a_machine_with_another_version_takes_nothing(
    target: str, world: str, tmp_path: Path, pool: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Store(target) as store:
        with monkeypatch.context() as elsewhere:
            elsewhere.setattr(episodes, "fingerprint", lambda names: "that of another version")
            [digest] = post(store, duels(world, tmp_path / "here"))
        with refused("scenario 'duel'", "another state of 'code'", "expected the nathlon and packages"):
            work_through(store, pool, world)
        assert store.waiting() == {digest: 3}
        assert store.owners() == []


def test_a_world_that_was_not_named_is_not_loaded(
    target: str, world: str, tmp_path: Path, pool: Pool
) -> None:
    with Store(target) as store:
        post(store, duels(world, tmp_path / "here"))
        with refused("which is code", "--world"):
            work(store, pool, wait_s=0.0)


def test_leases_end_by_the_clock_of_the_server(
    postgres: str, world: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    matches = duels(world, tmp_path / "here")
    with Store(postgres) as store:
        [digest] = post(store, matches)
        assert len(store.take(digest, "one", 3, 60)) == 3
        Clock(monkeypatch).ahead += timedelta(hours=1)
        assert store.take(digest, "two", 3, 60) == []
        assert store.at_work() == {}


def test_a_race_of_ours_is_the_same_elsewhere(postgres: str, tmp_path: Path, pool: Pool) -> None:
    checkpoint = tmp_path / "here.safetensors"
    shutil.copy(next(path for path in BUNDLED if path.stem.startswith("lindenring")), checkpoint)
    entrant = enter(str(checkpoint), "lindenring", "gt3")
    match = against("battery", "duel", "slipstream_pass", entrant, ["driver:pace=0.9"], [1], range(1))
    expected = results_of([match], pool)
    with Store(postgres) as store:
        post(store, [match])
        checkpoint.unlink()
        assert work(store, pool, wait_s=0.0) == Shift(1, 0)
        assert store.results_of([match.key]).equals(expected)


def test_an_older_store_gets_its_queue_in_place(target: str, world: str, tmp_path: Path, pool: Pool) -> None:
    first, *others = duels(world, tmp_path / "here")
    with Store(target) as store:
        post(store, [first])
        assert work_through(store, pool, world) == Shift(1, 0)
    for table in ("queue", "surroundings", "file", "worker"):
        change(target, sa.text(f"DROP TABLE {table}"))
    for table, column in (("match", "processor"), ("result", "stints")):
        change(target, sa.text(f"ALTER TABLE {table} DROP COLUMN {column}"))
    change(target, sa.text("UPDATE nathlon_version SET version_num = '0003'"))
    with Store(target) as store:
        assert store.has(first.key)
        post(store, [first, *others])
        assert work_through(store, pool, world) == Shift(2, 0)
        assert store.verify() == []
        ran_on = store.processors([match.key for match in (first, *others)])
        assert list(ran_on.values()) == [None, processor(), processor()]


def test_matches_that_others_hold_are_waited_for_and_run_when_their_leases_end(
    target: str, world: str, tmp_path: Path, pool: Pool
) -> None:
    matches = duels(world, tmp_path / "here")
    with Store(target) as store:
        store.claim([matches[1].key], "another machine", 1.0)
        ended = list(LocalEngine(store, pool).run(matches))
        assert sorted(key for key, _ in ended) == sorted(match.key for match in matches)
        assert ended[-1].key == matches[1].key
        assert all(here for _, here in ended)


def test_what_cannot_leave_this_machine_has_no_label(world: str, tmp_path: Path) -> None:
    [match] = duels(world, tmp_path / "here", 1)
    assert labels(match, shared=True) == [".onnx", ".onnx"]
    assert labels(match, shared=False) == list(match.sources)
    for kind, leaves in (("object:mine", False), ("mix.toml", False), ("plugin:mine", True)):
        other = replace(match, sources=(kind, match.sources[1]))
        assert (labels(other, shared=True) is not None) == leaves


@given(st.integers(1, 100_000), st.integers(1, 64), st.integers(0, 1000), st.integers(1, 10_000))
def test_a_share_is_no_more_than_what_gains_by_running_together(
    left: int, idle: int, at_work: int, full: int
) -> None:
    some = share(left, idle, at_work, full)
    assert 1 <= some <= 2 * full * idle
    if some > 1 and at_work >= 2 * idle:
        assert some <= left // 2, "others find work too"


@pytest.mark.parametrize("workers", [2, 3, 8])
def test_all_who_are_at_work_end_together(workers: int) -> None:
    """Of a hundred equal matches each worker runs its part, and none waits for longer than a match takes."""
    left, free_at = 100, [0] * workers
    ran = [0] * workers
    while left:
        now = min(free_at)
        worker = free_at.index(now)
        some = min(left, share(left, 1, workers, 16))
        left, ran[worker], free_at[worker] = left - some, ran[worker] + some, now + some
    assert max(free_at) - min(free_at) <= 1
    assert max(ran) - min(ran) <= 1


def test_a_share_is_of_what_nobody_has_claimed(target: str, world: str, tmp_path: Path, pool: Pool) -> None:
    matches = duels(world, tmp_path / "here", 16)
    with Store(target) as store, Claimant(store, pool, 60.0) as claimant:
        [digest] = post(store, matches)
        store.attend("another machine", 1, 60.0)
        store.take(digest, "another machine", 12, 60.0)
        taker = Taker(store, claimant, {digest}.__contains__, {}, {})
        assert store.waiting() == {digest: 16}
        assert [len(some) for some in taker(1)] == [1]


def change(target: str, statement: sa.TextClause, **values: str) -> None:
    engine = sa.create_engine(target if "://" in target else f"sqlite:///{target}")
    with engine.begin() as connection:
        connection.execute(statement, values)
    engine.dispose()


def test_of_many_that_wait_no_more_are_counted_than_asked_for(target: str) -> None:
    """By surroundings, in the order in which the first of each came."""
    facts: dict[str, Any] = {digest: {} for digest in ("few", "many", "done")}
    with Store(target) as store:
        for number, digest in enumerate(("done", "many", "few", *["many"] * 4)):
            store.enqueue([Queued(f"match {number}", digest, {}, [])], facts)
        store.withdraw(["match 0"])
        assert list(store.waiting().items()) == [("many", 5), ("few", 1)]
        assert list(store.waiting(3).items()) == [("many", 3), ("few", 1)]


@given(st.integers(1, 64), st.integers(0, 500), st.integers(1, 300), st.integers(0, 10_000))
def test_more_than_plenty_changes_no_share(idle: int, others: int, full: int, more: int) -> None:
    at_work = idle + others
    enough = plenty(at_work, full)
    assert share(enough, idle, at_work, full) == share(enough + more, idle, at_work, full)


def test_a_pause_holds_everybody_and_what_is_put_first_goes_first(
    world: str, tmp_path: Path, pool: Pool
) -> None:
    early = duels(world, tmp_path / "files")
    with Store(tmp_path / "store.sqlite") as store, Claimant(store, pool, 60.0) as claimant:
        [digest] = post(store, early)
        other = Queued("f" * 64, "0" * 64, {}, [])
        store.enqueue([other], {"0" * 64: {}})
        steer(store, "ann", paused=True)
        assert control(store).by == "ann"
        taker = Taker(store, claimant, lambda _: True, {match.key: match for match in early}, {})
        assert taker(1) == []
        assert store.waiting(unclaimed=True)[digest] == len(early)
        steer(store, "bob", paused=False, first="0" * 64)
        order: list[str] = []

        def accepts(digest: str) -> bool:
            order.append(digest)
            return False

        Taker(store, claimant, accepts, {}, {})(1)
        assert order == ["0" * 64, digest]
        # Both are in the log, for good.
        assert [entry.entry["by"] for entry in store.log(KIND)] == ["ann", "bob"]


def test_a_worker_says_how_fast_it_is_and_when_it_was_seen(tmp_path: Path) -> None:
    with Store(tmp_path / "store.sqlite") as store:
        owner = owner_name()
        store.attend(owner, 2, 60.0)
        time.sleep(0.01)
        store.attend(owner, 2, 60.0, ran=6)
        [told] = at_work(store)
        assert told.matches_per_minute is not None
        assert told.matches_per_minute > 0
        assert told.seen_at is not None
        assert told.seen_at > (store.workers()[0].began_at or "")

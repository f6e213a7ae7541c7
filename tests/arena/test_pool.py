"""Matches run together or alone, in whatever processes, come out the same; runs can be ended and go on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from multiprocessing import active_children, connection
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from nathlon.arena.entrant import enter
from nathlon.arena.grouping import CARS, MATCHES, fill, group
from nathlon.arena.job import HOG_BYTES, Loss, MatchJob, Opening, again
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.pool import Pool
from nathlon.arena.runner import run_match, run_together
from nathlon.arena.serving import _fall_silent
from nathlon.arena.watch import NOBODY, Asked, Patience, Taken, Watch
from nathlon.arena.workers import Worker, need_worker, new_output_log
from nathlon.selection.trials import against
from nathlon.sim.scratch import scratch_folder
from nathlon.sim.track import load_track
from tests.support.checkpoints import BUNDLED

pytestmark = pytest.mark.takes_long

SLOW = "driver:pace=0.85"
EARLY = "driver:early=30"


def duels(scenario: str, races: int = 2) -> list[Match]:
    """Matches of checkpoints and drivers among drivers, of unequal numbers of races."""
    sources = [str(BUNDLED[0]), str(BUNDLED[-1]), "driver:pace=0.7", EARLY]
    return [
        against(
            "battery",
            "duel",
            scenario,
            enter(source, "lindenring", "gt3"),
            [SLOW, EARLY],
            [1, 2],
            range(races + index % 2),
        )
        for index, source in enumerate(sources)
    ]


@pytest.fixture(scope="module")
def mixed_rates(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A scenario whose cars act at other rates than each other, see late, and finish one after the other."""
    path = tmp_path_factory.mktemp("scenarios") / "mixed.toml"
    begin, end = load_track("lindenring").stretch("longest straight")
    path.write_text(
        f"""
name = "mixed"
description = "Two cars of different reactions"
cars = 2
time_s = 14.0
finish_m = {begin + 450.0 - end}
origin = "longest straight"
action_hz = [10.0, 20.0]
perception_delay_s = [0.1, 0.05]

[start]
kind = "rolling"
leader_m = [30.0, 40.0]
gap_m = [13.0, 15.0]
lateral_m = [-1.0, 1.0]
speed_m_s = [40.0, 50.0]
"""
    )
    return str(path)


def alone(matches: list[Match]) -> dict[str, pl.DataFrame]:
    return {match.key: run_match(match, match_policies(match)) for match in matches}


def test_matches_in_one_world_have_the_bytes_that_they_have_alone(mixed_rates: str) -> None:
    for scenario in ("emergency_avoidance", mixed_rates):
        matches = duels(scenario)
        expected = alone(matches)
        rng = np.random.default_rng(3)
        for size in (2, 3, 4):
            chosen = [matches[index] for index in rng.permutation(len(matches))[:size]]
            line_ups = {number: (match, match_policies(match)) for number, match in enumerate(chosen)}
            together = dict(run_together(line_ups, Watch()))
            for number, match in enumerate(chosen):
                assert together[number].equals(expected[match.key])


def test_drivers_answer_for_a_car_whatever_cars_are_beside_it() -> None:
    """What lets one call serve all matches of a world."""
    [match] = duels("emergency_avoidance")[:1]
    rng = np.random.default_rng(0)
    for policy in match_policies(match)[1:]:
        seen = rng.standard_normal((40, policy.observation_spec.size), np.float32)
        memory = rng.standard_normal((40, 2), np.float32)
        actions, remembered = policy.act(seen, memory)
        for rows in (np.arange(1), np.arange(3, 17), rng.permutation(40)):
            some, kept = policy.act(seen[rows], memory[rows])
            assert some.tobytes() == actions[rows].tobytes()
            assert kept.tobytes() == remembered[rows].tobytes()


def test_a_race_of_built_in_drivers_needs_no_other_process() -> None:
    match = duels("slipstream_pass")[2]
    assert not need_worker(match.sources)
    with Pool(1) as pool:
        pool.here = True
        [(_, results)] = pool.run([match])
        assert not active_children()
    assert results.equals(alone([match])[match.key])


@pytest.mark.parametrize("other", [str(BUNDLED[0]), "generalist", "plugin:mine", "object:mine"])
def test_a_race_of_others_does(other: str) -> None:
    assert need_worker(["driver", other])


def test_a_pool_keeps_its_processes_and_its_results(mixed_rates: str) -> None:
    matches = duels(mixed_rates)
    expected = alone(matches)
    with Pool(2) as pool:
        first = dict(pool.run(matches[:3]))
        processes = {child.pid for child in active_children()}
        second = dict(pool.run(matches))
        assert {child.pid for child in active_children()} == processes
        assert len(processes) == 2
        assert [match for match, _ in pool.run([])] == []
        given_up = pool.run(matches)
        next(given_up)
        given_up.close()
        third = dict(pool.run(matches[2:]))
    assert not active_children()
    for results in (first, second, third):
        assert all(frame.equals(expected[match.key]) for match, frame in results.items())
    assert (len(first), len(second), len(third)) == (3, 4, 2)


@given(
    st.lists(st.tuples(st.sampled_from(["race", "1v0", "sprint", "grand_prix"]), st.integers(1, 40))),
    st.integers(1, 64),
)
@example([("race", 1)] * 11 + [("race", 30)] * 2, 1)
@settings(max_examples=50, deadline=None)
def test_groups_hold_every_match_once_and_nothing_unlike(kinds: list[tuple[str, int]], workers: int) -> None:
    matches = [
        Match(
            "test",
            str(index),
            scenario,
            "lindenring",
            "gt3",
            ("a",),
            ("a",),
            (Race(index, (Seat(0),)),) * races,
        )
        for index, (scenario, races) in enumerate(kinds)
    ]
    groups = group(matches, workers)
    assert sorted(match.test for those in groups for match in those) == sorted(m.test for m in matches)
    assert all(len({match.scenario for match in those}) == 1 for those in groups)
    grids = {"race": 8, "1v0": 1, "sprint": 8, "grand_prix": 20}
    for those in groups:
        cars = [grids[match.scenario] * len(match.races) for match in those]
        assert sum(cars) <= CARS + max(cars)


def test_groups_are_even_and_there_is_enough_for_all_workers() -> None:
    def filter_match(index: int) -> Match:
        return Match("t", str(index), "race", "lindenring", "gt3", ("a",), ("a",), (Race(1, (Seat(0),)),) * 4)

    for count, workers, sizes in ((22, 2, [5, 5, 6, 6]), (1000, 2, [8]), (3, 8, [1]), (1, 2, [1])):
        groups = group([filter_match(index) for index in range(count)], workers)
        found = sorted(map(len, groups))
        assert found == sizes or sorted(set(found)) == sizes


def test_no_group_has_more_matches_than_have_room_in_memory() -> None:
    alone = [
        Match("t", str(i), "1v0", "lindenring", "gt3", ("a",), ("a",), (Race(1, (Seat(0),)),))
        for i in range(200)
    ]
    assert [len(those) for those in group(alone, 1)] == [50] * 4
    assert fill(alone[0]) == MATCHES


def job(name: str, **facts: object) -> MatchJob:
    match = Match(
        "t", name, "1v1", "lindenring", "gt3", ("a", "b"), ("a", "b"), (Race(1, (Seat(0), Seat(1))),)
    )
    return MatchJob(match, **facts)  # type: ignore[arg-type]


def test_what_a_lost_worker_leaves_is_run_again() -> None:
    a, b, c = job("a"), job("b"), job("c")
    jobs = {0: a, 2: b, 5: c}
    late, crash = (again(jobs, Loss(Asked(9, 2, 1, 1.0), late)) for late in (True, False))
    assert late == ([[a, c], [job("b", absent={1: "timed_out"})]], [])
    assert crash == ([[a, c], [job("b", alone=True)]], [])
    nobody = Asked(9, NOBODY, NOBODY, 1.0)
    assert again(jobs, Loss(nobody))[0] == [[job(name, alone=True)] for name in "abc"]
    by_itself = {0: job("b", alone=True, absent={0: "timed_out"})}
    groups, [(given_up, answer)] = again(by_itself, Loss(nobody))
    assert (groups, given_up) == ([], by_itself[0])
    assert set(answer.results["ending"]) == {"simulator_fault"}
    assert again(by_itself, Loss(Asked(9, 0, 1, 1.0))) == (
        [[job("b", absent={0: "timed_out", 1: "policy_raised"})]],
        [],
    )


def test_nobody_is_blamed_for_what_a_worker_sends() -> None:
    asked = Asked(9, 0, 1, 1.0)
    spoilt = Loss(asked, unreadable=True)
    assert again({0: job("a")}, spoilt) == ([[job("a", alone=True)]], [])
    groups, [(_, answer)] = again({0: job("a", alone=True)}, spoilt)
    assert groups == []
    assert set(answer.results["ending"]) == {"simulator_fault"}
    opening = Opening("plugin:p", str, (), alone=True)
    _, [(_, refusal)] = again({0: opening}, spoilt)
    assert "spoilt what the process that opened it sends" in str(refusal)


def test_who_closes_what_its_process_answers_through_is_known() -> None:
    alone = {0: job("a", alone=True)}
    by_policy = Loss(Asked(9, 0, 1, 1.0), closed=True)
    assert again({0: job("a")}, by_policy) == ([[job("a", alone=True)]], [])
    assert again(alone, by_policy) == ([[job("a", absent={1: "policy_raised"})]], [])
    _, [(_, answer)] = again(alone, Loss(Asked(9, NOBODY, NOBODY, 1.0), closed=True))
    assert set(answer.results["ending"]) == {"simulator_fault"}, "a world's own code may do it too"


def test_what_hangs_while_it_is_opened_has_one_limit() -> None:
    opening, other = Opening("slow.pt", str, ()), Opening("other.pt", str, ())
    hung = Loss(Asked(9, 0, 0, 120.0), late=True, hung=True)
    groups, [(given_up, refusal)] = again({0: opening, 1: other}, hung)
    assert (groups, given_up) == ([[other]], opening)
    assert str(refusal) == "slow.pt: took more than 120 s to open, expected a policy"
    assert again({0: job("a")}, hung) == ([[job("a", alone=True)]], []), "a match may do better alone"


def test_memory_is_laid_to_who_took_it_once_a_match_runs_by_itself() -> None:
    jobs = {0: job("a"), 1: job("b")}
    asked = Asked(9, 1, 0, 1.0)
    shared = Loss(asked, memory=True, taken=Taken(1, HOG_BYTES))
    assert again(jobs, shared) == ([[job("a", alone=True)], [job("b", alone=True)]], [])
    alone = {0: job("a", alone=True)}
    at_work = Loss(Asked(9, NOBODY, NOBODY, 1.0), memory=True)
    for entrant in (0, 1):
        hog = at_work._replace(taken=Taken(entrant, HOG_BYTES))
        assert again(alone, hog) == ([[job("a", absent={entrant: "policy_raised"})]], [])
    greedy = Loss(Asked(9, 0, 1, 1.0), memory=True, taken=Taken(0, HOG_BYTES - 1))
    assert again(alone, greedy) == ([[job("a", absent={1: "policy_raised"})]], [])
    groups, [(given_up, answer)] = again(alone, at_work)
    assert (groups, given_up) == ([], alone[0])
    assert set(answer.results["ending"]) == {"simulator_fault"}


def test_patience_ends_with_whoever_does_not_get_on() -> None:
    watch = Watch(answer_s=0.0, first_answer_s=1e6)
    patience = Patience(watch)
    watch.ask(3, 1, first=True)
    assert not any(patience.over for _ in range(3))
    for _ in range(2):
        watch.ask(3, 1, first=False)
        assert not patience.over, "it has just begun"
        assert patience.over
    assert watch.asked[1:] == (3, 1, 0.0)
    watch.rest()
    assert not any(patience.over for _ in range(3))


SCRIPT = """
import multiprocessing, sys
from nathlon.arena.entrant import enter
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import run_matches

if __name__ == "__main__":
    only = enter(sys.argv[1], "lindenring", "gt3")
    matches = [
        Match("", "", name, "lindenring", "gt3", (only.id,), (only.source,), (Race(1, (Seat(0),) * n),) * 32)
        for name, n in (("race", 8), ("emergency_avoidance", 3))
    ]
    for match, results in run_matches(matches, 2):
        print(*(child.pid for child in multiprocessing.active_children()), flush=True)
"""


def babble(pipe: connection.Connection, watch: Watch, sink: connection.Connection) -> None:
    pipe.send_bytes(b"no pickle")
    time.sleep(1e6)


def break_off(pipe: connection.Connection, watch: Watch, sink: connection.Connection) -> None:
    os.write(pipe.fileno(), b"\0\0\1\0half of a message")
    time.sleep(1e6)


@pytest.mark.parametrize(
    "serve",
    [
        babble,
        pytest.param(break_off, marks=pytest.mark.skipif(os.name != "posix", reason="writes half messages")),
    ],
)
def test_a_worker_that_sends_what_cannot_be_read_is_ended(
    serve: Callable[[connection.Connection, Watch, connection.Connection], None],
) -> None:
    log = new_output_log()
    worker = Worker(serve, log.sink, 10.0, 0.0, 10.0)
    connection.wait(worker.signs)
    assert list(worker.news()) == []
    assert worker.dead
    assert worker.unreadable
    log.close()


@pytest.mark.skipif(os.name != "posix", reason="forks")
def test_what_a_policy_forks_does_not_run_the_match_beside_its_parent() -> None:
    pipe, theirs = connection.Pipe()
    read, write = os.pipe()
    watch = Watch()
    if (forked := os.fork()) == 0:
        try:
            _fall_silent(pipe, watch)
            watch.work()  # as after every answer
            os.write(write, b"went on")
        finally:
            os._exit(0)
    os.close(write)
    assert os.read(read, 9) == b""
    assert os.waitstatus_to_exitcode(os.waitpid(forked, 0)[1]) == 1
    os.close(read)
    pipe.close()
    theirs.close()


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_workers_too_and_leaves_no_folder(
    sent: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    with tempfile.TemporaryDirectory() as place:  # names of sockets are short
        _end_by(sent, script, Path(place), monkeypatch)


def _end_by(sent: signal.Signals, script: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environment = os.environ | {
        "PYTHONPATH": str(Path(__file__).parent.parent.parent),
        "TMPDIR": str(temporary),
    }
    with subprocess.Popen(
        [sys.executable, script, BUNDLED[0]],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
    ) as process:
        assert process.stdout
        workers = [int(pid) for pid in process.stdout.readline().split()]
        assert workers
        process.send_signal(sent)
        process.wait(60.0)
    end = time.monotonic() + 10.0
    while any(map(alive, workers)) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(map(alive, workers))
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    with scratch_folder() as next_one:
        assert list(temporary.iterdir()) == [Path(next_one)]


INTERRUPTED = """
import os, signal, sys, time
from nathlon.arena.workers import start_server

if __name__ == "__main__":
    start_server()
    try:
        os.killpg(0, signal.SIGINT)
        time.sleep(60.0)
    except KeyboardInterrupt:
        from nathlon.arena.entrance import enter_all
        from nathlon.arena.pool import Pool

        with Pool(1) as pool:
            print(enter_all(pool, sys.argv[1:], "lindenring", "gt3")[0].name)
"""


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
def test_ctrl_c_while_the_workers_libraries_load_is_answered_by_the_command_alone(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED)
    done = subprocess.run(
        [sys.executable, script, BUNDLED[0]],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parent.parent.parent)},
        start_new_session=True,
    )
    assert done.stdout.split() == [BUNDLED[0].stem]
    assert not done.stderr


def alive(process: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False

"""What a policy is blamed for: the time in which it runs or sleeps, and not what the machine is busy with."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import pytest

from nathlon.arena import watch as watching
from nathlon.arena.job import Loss, again
from nathlon.arena.results import INTERRUPTED
from nathlon.arena.watch import NOBODY, Asked, Patience, Watch
from nathlon.policies import patience as waiting
from nathlon.policies.patience import LOOK_S, Waiting
from nathlon.sim.process import Scheduled, scheduled
from tests.arena.test_pool import job


class Machine:
    """A machine on which a process runs, sleeps or waits for a processor as it is told to."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock_s = self.ran_s = self.queued_s = 0.0
        for name in ("perf_counter", "monotonic"):
            monkeypatch.setattr(time, name, lambda: self.clock_s)
        monkeypatch.setattr(time, "process_time", lambda: self.ran_s)
        for module in (watching, waiting):
            monkeypatch.setattr(module, "scheduled", self.told)

    def told(self, _: int) -> Scheduled | None:
        return Scheduled(self.ran_s, self.queued_s)

    def run(self, s: float) -> None:
        self.clock_s += s
        self.ran_s += s

    def sleep(self, s: float) -> None:
        self.clock_s += s

    def starve(self, s: float) -> None:
        self.clock_s += s
        self.queued_s += s


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine(monkeypatch)


def answer(watch: Watch, spend: Callable[[float], None], s: float) -> None:
    """An answer that takes so long, and what the simulator does afterwards."""
    watch.ask(0, 1, first=False)
    spend(s)
    watch.work()


def test_a_match_counts_what_a_policy_runs_and_sleeps_and_not_what_others_run(machine: Machine) -> None:
    watch = Watch(match_s=300.0)
    for _ in range(1000):
        answer(watch, machine.starve, 8.0)
        answer(watch, machine.run, 0.1)
        machine.starve(5.0)
    assert not watch.used_up(0, 1), "at a load of 80 it took 100 s of its own"
    for _ in range(25):
        answer(watch, machine.sleep, 8.0)
    assert not watch.used_up(0, 1)
    answer(watch, machine.sleep, 8.0)
    assert watch.used_up(0, 1)
    assert not watch.used_up(0, 0)


def test_where_the_system_does_not_tell_only_processor_time_counts(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "told", lambda _: None)
    monkeypatch.setattr(watching, "scheduled", lambda _: None)
    watch = Watch(match_s=300.0)
    answer(watch, machine.sleep, 1000.0)
    assert not watch.used_up(0, 1)
    answer(watch, machine.run, 301.0)
    assert watch.used_up(0, 1)


def looked_at(machine: Machine, spend: Callable[[float], None], limit_s: float, looks: int) -> Patience:
    """The patience with a process that is asked, after so many looks of a second."""
    watch = Watch(answer_s=limit_s)
    patience = Patience(watch, 1)
    watch.ask(0, 1, first=False)
    assert not patience.over
    for look in range(looks):
        assert not patience.over, look
        spend(LOOK_S)
    return patience


def test_an_answer_is_late_by_what_its_process_ran_or_slept(machine: Machine) -> None:
    starved = looked_at(machine, machine.starve, 10.0, 200)
    assert not starved.over
    busy = looked_at(machine, machine.run, 10.0, 11)
    assert busy.over
    assert not busy.asleep
    hung = looked_at(machine, machine.sleep, 10.0, 11)
    assert hung.over
    assert hung.asleep


def test_time_in_which_nobody_looks_does_not_count(machine: Machine) -> None:
    waiting_for = Waiting(1)
    machine.sleep(3600.0)
    assert waiting_for.look() == LOOK_S


def test_who_hangs_is_run_again_by_itself_before_it_is_blamed() -> None:
    """The machine may have been busy with its disk."""
    jobs = {0: job("a"), 2: job("b")}
    hung = Loss(Asked(9, 2, 1, 1.0), late=True, hung=True)
    assert again(jobs, hung) == ([[jobs[0]], [job("b", alone=True)]], [])
    alone = {0: job("b", alone=True)}
    guilty = hung._replace(asked=Asked(9, 0, 1, 1.0))
    assert again(alone, guilty) == ([[job("b", absent={1: "timed_out"})]], [])
    _, [(_, answer)] = again(alone, guilty._replace(asked=Asked(9, NOBODY, NOBODY, 1.0)))
    assert set(answer.results["ending"]) == {INTERRUPTED}, "the match is run again another time"


def test_the_system_tells_what_a_process_has_had_of_the_processors() -> None:
    before = scheduled(os.getpid())
    if before is None:
        pytest.skip("this system does not tell")
    until = time.thread_time() + 0.02
    while time.thread_time() < until:
        pass
    after = scheduled(os.getpid())
    assert after is not None
    assert after.ran_s - before.ran_s >= 0.015
    assert after.queued_s >= before.queued_s
    assert scheduled(2**22 + 1) is None

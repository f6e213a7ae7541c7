"""The executor of a Ray cluster: an actor a node, fed from here, and done without when its node is gone."""

from __future__ import annotations

import json
import logging
import time
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

from nathlon.arena.executor import Executor, Round
from nathlon.arena.grouping import group
from nathlon.arena.job import Answer, Job, MatchJob
from nathlon.arena.on_ray.cluster import RayNode, places
from nathlon.arena.on_ray.node import Load, Node, NodeEnded
from nathlon.arena.output_log import OutputLog
from nathlon.arena.payload import Payload, labels, send
from nathlon.arena.queue import Where, facts_of, where_of
from nathlon.arena.recorder import Recorded
from nathlon.policies.ray_actor import start_actor
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import write_whole

log = logging.getLogger(__name__)

MEET_S, NEWS_S = 2.0, 1.0
"""Between two looks at which nodes there are, and at what they have to tell."""
WARN_S, WAIT_S = 20.0, 300.0
"""For a node that takes matches, where there is none: until that is said, and until it is given up."""
LIVES = 3
"""Actors that a node may lose before it gets no other."""

_actors = count(1)


@dataclass(eq=False)
class _Hand:
    """A node that works for us.

    Attributes:
        actor: on the node.
        call: under way; None while it waits for something to do.
        given: what it has not told the end of, by number.
        held: what it is given as soon as it is prepared.
        idle: processes that had nothing to do when it told the last time.
        prepared: for which surroundings.
        there: digests of the files that it has.
        ready: whether its actor has ever answered.
    """

    place: RayNode
    actor: Any
    call: Any
    given: dict[int, MatchJob] = field(default_factory=dict)
    held: list[dict[int, MatchJob]] = field(default_factory=list)
    idle: int = 0
    prepared: set[Where] = field(default_factory=set)
    there: set[str] = field(default_factory=set)
    ready: bool = False


class Nodes(Executor):
    """The nodes of the Ray cluster that this process has joined; they may come and go.

    To be used in a `with` statement.
    """

    def __init__(self, log: OutputLog) -> None:
        """Nodes whose actors begin to start; what policies print there goes into a log."""
        self._log = log
        self._hands: list[_Hand] = []
        self._losses: dict[str, int] = defaultdict(int)
        self._unfit: dict[str, str] = {}
        self._there: dict[str, RayNode] = {}
        self._numbers = count()
        self._next_meeting = 0.0
        self.workers = 0
        self._meet()

    def __enter__(self) -> Nodes:
        return self

    def __exit__(self, *_: object) -> None:
        for hand in list(self._hands):
            self._dismiss(hand)

    def work(self, feed: Callable[[int], Sequence[list[Job]]]) -> Generator[Round, None, None]:
        """As of `Executor`, of jobs whose policies can leave here; see `nathlon.arena.payload.labels`.

        Raises:
            InputError: if no node can do them.
        """
        queue: deque[list[MatchJob]] = deque()
        began, warned = time.monotonic(), False
        try:
            while True:
                self._meet()
                free = [hand for hand in self._hands if hand.call is None]
                if any(hand.ready for hand in self._hands):
                    began, warned = time.monotonic(), False
                waited_s = time.monotonic() - began
                self._check(waited_s)
                if waited_s > WARN_S and not warned:
                    log.warning("engine 'ray': no node has free processors; waiting for one")
                    warned = True
                idle = sum(hand.idle for hand in free)
                if idle and not queue:
                    queue.extend([job for job in jobs if isinstance(job, MatchJob)] for jobs in feed(idle))
                for hand in free:
                    self._give(hand, [queue.popleft() for _ in range(min(hand.idle, len(queue)))])
                if free and not queue and not any(hand.given for hand in self._hands):
                    break
                yield list(self._news(queue))
        finally:
            # Only those that are at work when the run is given up.
            for hand in [hand for hand in self._hands if hand.given]:
                self._dismiss(hand)

    def _meet(self) -> None:
        """Have an actor started on each node that has joined, and forget those that have left."""
        if time.monotonic() < self._next_meeting:
            return
        self._there = places()
        for hand in [hand for hand in self._hands if hand.call is None and not hand.given]:
            if hand.place.id not in self._there:
                self._dismiss(hand)
        met = {hand.place.id for hand in self._hands} | self._unfit.keys()
        self._hands += [self._start(place) for id, place in self._there.items() if id not in met]
        self.workers = sum(hand.place.processors for hand in self._hands)
        self._next_meeting = time.monotonic() + MEET_S

    def _start(self, place: RayNode) -> _Hand:
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        called = f"nathlon {place.name} {next(_actors)}", f"node {place.name}"
        there = NodeAffinitySchedulingStrategy(place.id, soft=False)
        # What runs is told by claims.
        actor = start_actor(
            Node, *called, place.processors, num_cpus=place.processors, scheduling_strategy=there
        )
        return _Hand(place, actor, actor.prepare.remote([]), idle=place.processors)

    def _check(self, waited_s: float) -> None:
        """See that there is a node to hope for."""
        reasons = [reason for id, reason in self._unfit.items() if id in self._there]
        if reasons and not self._hands:
            raise InputError(f"engine 'ray': {reasons[0]}")
        if waited_s > WAIT_S:
            raise InputError(
                f"engine 'ray': no node of the cluster had free processors for {WAIT_S:.0f} s, expected some"
            )

    def _give(self, hand: _Hand, groups: Sequence[list[MatchJob]]) -> None:
        """Give a node more to do, if it has nothing else to be called for; and let it go on."""
        hand.held = [{next(self._numbers): job for job in jobs} for jobs in groups]
        for jobs in hand.held:
            hand.given |= jobs
        new = {where_of(job.match) for jobs in groups for job in jobs} - hand.prepared
        if new:
            hand.call = hand.actor.prepare.remote([json.dumps(facts_of(*where)) for where in sorted(new)])
            hand.prepared |= new
        elif hand.given:
            self._go_on(hand)

    def _go_on(self, hand: _Hand) -> None:
        payload = Payload(hand.place.name, there=hand.there)
        send(payload, [job.match for jobs in hand.held for job in jobs.values()])
        groups = [{number: _packed(job) for number, job in jobs.items()} for jobs in hand.held]
        hand.call = hand.actor.work.remote(Load(groups, payload.contents))
        hand.there |= payload.contents.keys()
        hand.held = []

    def _news(self, queue: deque[list[MatchJob]]) -> Iterator[tuple[Job, Answer]]:
        """Wait for news; results as they come, and into the queue what a lost node leaves."""
        import ray

        called = {hand.call: hand for hand in self._hands if hand.call is not None}
        if not called:
            time.sleep(NEWS_S)
            return
        ray.wait(list(called), timeout=NEWS_S)
        ready, _ = ray.wait(list(called), num_returns=len(called), timeout=0)
        for call in ready:
            hand = called[call]
            try:
                answer = ray.get(call)
            except ray.exceptions.RayTaskError as error:
                # Our own error is for the user to see, a full disk only for whoever runs that machine.
                if not isinstance(error, OSError):
                    raise
                self._lose(hand, queue, f"cannot go on ({error.cause})", for_good=True)
            except ray.exceptions.RayError as error:
                self._lose(hand, queue, self._reason(hand, error), for_good=not hand.ready)
            else:
                hand.call, hand.ready = None, True
                if isinstance(answer, str):
                    self._lose(hand, queue, answer, for_good=True)
                elif answer is None and hand.held:
                    self._go_on(hand)
                elif answer is not None:
                    hand.idle = answer.idle
                    self._log.add(answer.printed)
                    for ended in answer.ended:
                        yield _received(hand.given.pop(ended.number), ended, answer.processor)

    def _lose(self, hand: _Hand, queue: deque[list[MatchJob]], reason: str, for_good: bool) -> None:
        """Put what a node leaves before all else that waits; it may get another actor, unless for good."""
        self._dismiss(hand)
        self._losses[hand.place.id] += 1
        if for_good or self._losses[hand.place.id] == LIVES:
            self._unfit[hand.place.id] = f"node {hand.place.name} {reason}"
        raced = {job.match.key: job for job in hand.given.values() if not job.wanted}
        again = [[job] for job in hand.given.values() if job.wanted]
        if raced:
            matches = [job.match for job in raced.values()]
            again += [
                [raced[match.key] for match in those] for those in group(matches, hand.place.processors)
            ]
        queue.extendleft(reversed(again))
        log.warning("node %s %s; others run its %d matches", hand.place.name, reason, len(hand.given))
        self._next_meeting = 0.0

    def _reason(self, hand: _Hand, error: Exception) -> str:
        """What became of a node whose actor is lost, as a clause."""
        if hand.place.id not in places():
            return "has left"
        if hand.ready:
            return "has lost its actor"
        return f"cannot begin ({str(error).strip().splitlines()[-1]})"

    def _dismiss(self, hand: _Hand) -> None:
        import ray

        self._hands.remove(hand)
        ray.kill(hand.actor)


def _packed(job: MatchJob) -> MatchJob:
    """A job as it travels: its policies by their labels."""
    match = replace(job.match, sources=tuple(labels(job.match, shared=True) or ()))
    return replace(job, match=match, wanted=job.wanted and job.wanted._replace(match=match))


def _received(job: MatchJob, ended: NodeEnded, processor: str) -> tuple[MatchJob, Answer]:
    """A job and its answer, with its recordings where they are wanted."""
    answer = ended.answer
    if isinstance(answer, Recorded):
        answer = answer._replace(processor=processor)
    folder = job.wanted and job.wanted.folder
    if folder is None:
        return job, answer
    try:
        for name, content in ended.files.items():
            write_whole(folder / name, content)
    except OSError as error:
        return job, InputError(f"{folder}: the recording cannot be written: {error.strerror}")
    return job, answer

"""What an actor does: it runs jobs with the pool of its node, and tells what has ended."""

from __future__ import annotations

import json
import shutil
import time
from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from nathlon.arena.entrance import check_world
from nathlon.arena.executor import Round
from nathlon.arena.job import Answer, Job, MatchJob
from nathlon.arena.kernels import compile_kernels
from nathlon.arena.payload import Arrivals, Payload
from nathlon.arena.pool import Pool
from nathlon.arena.processor import processor
from nathlon.arena.queue import difference
from nathlon.sim.errors import InputError
from nathlon.sim.local_cache import keep_caches_here
from nathlon.sim.scratch import scratch_folder

GATHER_S, TELL_S = 0.25, 1.0
"""For which results are gathered, and after which it tells that there are none."""


class Load(NamedTuple):
    """What a node is given.

    Attributes:
        groups: jobs by their numbers, which may run together. A policy's source is its label, see
            `nathlon.arena.payload.labels`.
        files: that the node does not have yet, by the SHA-256 of their contents.
    """

    groups: list[dict[int, MatchJob]]
    files: dict[str, bytes]


class NodeEnded(NamedTuple):
    """A job that has ended.

    Attributes:
        number: of the job.
        answer: as of a pool.
        files: recordings that it has left, by name.
    """

    number: int
    answer: Answer
    files: dict[str, bytes]


class Told(NamedTuple):
    """What a node has done.

    Attributes:
        ended: since it told the last time.
        idle: processes that have nothing to do.
        printed: by policies since then.
        processor: kind of processor of the node.
    """

    ended: list[NodeEnded]
    idle: int
    printed: str
    processor: str


class Node:
    """The processes of a node. Its methods are called by one who waits for each to return."""

    def __init__(self, name: str, workers: int) -> None:
        """A node without processes yet; `name` is for messages."""
        keep_caches_here()
        self._pool = Pool(workers)
        self._payload = Payload(name)
        self._arrivals = Arrivals(self._payload)
        self._folder = scratch_folder()
        self._backlog: deque[list[Job]] = deque()
        self._numbers: dict[int, int] = {}
        self._compiled = set[tuple[str, str, str]]()
        self._idle, self._printed = workers, 0
        self._rounds: Generator[Round, None, None] | None = None

    def prepare(self, surroundings: Sequence[str]) -> str | None:
        """Make ready for matches of some surroundings, in JSON: why they cannot be run here, in a clause."""
        # In processes of their own: those of the pool may be at work.
        with Pool(self._pool.workers) as pool:
            for facts in map(json.loads, surroundings):
                place = facts["world"], facts["circuit"], facts["car"]
                try:
                    if place not in self._compiled:
                        check_world(pool, facts["world"])
                    if lack := difference(facts):
                        return f"has {lack}, expected the nathlon and packages of the run"
                except InputError as error:
                    return f"lacks what a match needs: {error}"
                if place not in self._compiled:
                    compile_kernels(pool, *place, lambda done, total: None)
                    self._compiled.add(place)
        return None

    def work(self, load: Load) -> Told:
        """Take more to do, and go on until something has ended or a moment is over."""
        ended = self._take(load)
        now = time.monotonic()
        gathered, over = now + GATHER_S, now + TELL_S
        while True:
            if self._rounds is None:
                self._rounds = self._pool.work(self._feed)
            try:
                ended += [self._told(job, answer) for job, answer in next(self._rounds)]
            except StopIteration:
                self._rounds = None
                if self._backlog:
                    continue
                break
            now = time.monotonic()
            if now >= over or (ended and (self._idle or now >= gathered)):
                break
        printed = self._pool.log.text
        news, self._printed = printed[self._printed :], len(printed)
        return Told(ended, self._idle, news, processor())

    def _take(self, load: Load) -> list[NodeEnded]:
        """Put jobs into the backlog; those that end by that."""
        refused = []
        self._payload.contents = load.files
        for group in load.groups:
            jobs: list[Job] = []
            for number, racing in group.items():
                try:
                    job = self._unpacked(number, racing)
                except InputError as error:
                    refused.append(NodeEnded(number, error, {}))
                else:
                    self._numbers[id(job.match)] = number
                    jobs.append(job)
            if jobs:
                self._backlog.append(jobs)
        return refused

    def _unpacked(self, number: int, racing: MatchJob) -> MatchJob:
        labels = zip(racing.match.entrants, racing.match.sources, strict=True)
        match = replace(racing.match, sources=tuple(self._arrivals.source(*each) for each in labels))
        wanted = racing.wanted and racing.wanted._replace(match=match)
        if wanted and wanted.folder:
            wanted = wanted._replace(folder=self._left_by(number))
            self._left_by(number).mkdir()
        return replace(racing, match=match, wanted=wanted)

    def _left_by(self, number: int) -> Path:
        """The folder for what a job leaves."""
        return Path(self._folder.name) / str(number)

    def _feed(self, idle: int) -> list[list[Job]]:
        groups = [self._backlog.popleft() for _ in range(min(idle, len(self._backlog)))]
        self._idle = idle - len(groups)
        return groups

    def _told(self, job: Job, answer: Answer) -> NodeEnded:
        assert isinstance(job, MatchJob)
        # The pool may have done it as another job, but never changes the match.
        number = self._numbers.pop(id(job.match))
        folder = self._left_by(number)
        files = {path.name: path.read_bytes() for path in folder.iterdir()} if folder.exists() else {}
        shutil.rmtree(folder, ignore_errors=True)
        return NodeEnded(number, answer, files)

"""Rollout workers that are actors of a Ray cluster, on whatever nodes it has."""

from __future__ import annotations

import logging
import time
from collections import deque
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from nathlon.policies.ray_actor import start_actor
from nathlon.policies.training.on_ray.actor import Begin, RolloutActor
from nathlon.policies.training.on_ray.travel import needed, pack
from nathlon.policies.training.worker import Gathered, News, WorkerSetup
from nathlon.policies.training.worker_pool import STEPS_AHEAD, Take
from nathlon.sim.decisive import fingerprint
from nathlon.sim.errors import InputError

log = logging.getLogger(__name__)

LOOK_S = 1.0
"""Between two looks at what has become of workers, while nothing comes."""
WARN_S, WAIT_S = 20.0, 300.0
"""For a free processor: until it is said that there is none, and until it is given up."""
LIVES = 3
"""Processes that a worker may lose in a row, none of which has made a step."""

_actors = count(1)


@dataclass(eq=False)
class _RemoteWorker:
    """A rollout worker.

    Attributes:
        calls: under way, in their order.
        since: when its actor was asked for, s.
        version: of the news that it has been told.
        known: checkpoints that it has been sent.
        answered: calls that have come back.
        losses: processes lost since the last step.
    """

    actor: Any
    calls: deque[Any]
    since: float
    version: int
    known: int
    answered: int = 0
    losses: int = 0


@dataclass
class _Post:
    """News and the files that they speak of, each of which lies in Ray's object store once."""

    news: News
    version: int = 0
    letter: Any = None
    checkpoints: list[Any] = field(default_factory=list)

    def renew(self, news: News) -> None:
        self.news, self.version, self.letter = news, self.version + 1, None

    def since(self, version: int, known: int) -> tuple[Any, list[Any]]:
        """What a worker is told that has heard a version and has some checkpoints; None if it knows all."""
        import ray

        if version == self.version:
            return None, []
        if self.letter is None:
            self.letter = ray.put(self.news)
            new = self.news.past[len(self.checkpoints) :]
            self.checkpoints += [ray.put(pack(str(path))) for path in new]
        return self.letter, self.checkpoints[known:]


class RayWorkers:
    """Workers in processes that Ray starts wherever a processor is free; this process has joined its cluster.

    Each goes on stepping until it is `STEPS_AHEAD`, with the news of its last call. One that is lost is
    replaced by another, with races of its own from their start.
    """

    def __init__(self, setup: WorkerSetup) -> None:
        """Ask for the processes, as many as the configuration says.

        Raises:
            InputError: if a file that they need cannot be read.
        """
        import ray

        config, pairs, network, news, self._seed = setup
        parcels = [pack(name) for name in needed(config, pairs)]
        self._begin = ray.put(Begin(fingerprint(), config, tuple(pairs), network, parcels))
        self._post = _Post(news)
        self._warned = False
        self._hands = [self._start() for _ in range(config.workers)]

    def _start(self) -> _RemoteWorker:
        number = next(_actors)
        called = f"nathlon rollouts {number}", f"rollout worker {number}"
        # Races that are repeated would be others.
        actor = start_actor(RolloutActor, *called, num_cpus=1, scheduling_strategy="SPREAD")
        [seed] = self._seed.spawn(1)
        letter, checkpoints = self._post.since(-1, 0)
        hand = _RemoteWorker(
            actor, deque(), time.monotonic(), self._post.version, len(self._post.checkpoints)
        )
        hand.calls += [actor.ready.remote(), actor.begin.remote(self._begin, seed, letter, *checkpoints)]
        for _ in range(STEPS_AHEAD):
            self._ask(hand)
        return hand

    def _ask(self, hand: _RemoteWorker) -> None:
        letter, checkpoints = self._post.since(hand.version, hand.known)
        hand.calls.append(hand.actor.step.remote(letter, *checkpoints))
        hand.version, hand.known = self._post.version, len(self._post.checkpoints)

    def take(self, wait_for_one: bool) -> Take:
        """As of `WorkerPool`."""
        while True:
            taken = self._came(LOOK_S if wait_for_one else 0.0)
            self._check()
            if taken or not wait_for_one:
                return taken

    def _came(self, wait_s: float) -> Take:
        import ray

        first = {hand.calls[0]: index for index, hand in enumerate(self._hands)}
        ray.wait(list(first), timeout=wait_s)
        ready, _ = ray.wait(list(first), num_returns=len(first), timeout=0)
        taken: Take = []
        for call in ready:
            index = first[call]
            hand = self._hands[index]
            try:
                answer = ray.get(call)
            except ray.exceptions.RayTaskError as error:
                # What is wrong with the rollouts is so on every node.
                if isinstance(error.cause, InputError):
                    raise InputError(str(error.cause)) from None
                raise
            except ray.exceptions.RayError:
                self._replace(index)
                taken.append((index, None))
                continue
            hand.calls.popleft()
            hand.answered += 1
            if answer is not None:
                hand.losses = 0
                taken.append((index, _writable(answer)))
                self._ask(hand)
        return taken

    def _replace(self, index: int) -> None:
        lost = self._hands[index]
        self._end(lost)
        if lost.losses + 1 == LIVES:
            raise InputError(
                f"engine 'ray': rollout worker {index + 1} has lost {LIVES} processes, none of which made "
                "a step, expected one that does"
            )
        log.warning("engine 'ray': rollout worker %d is lost; another takes its place", index + 1)
        self._hands[index] = self._start()
        self._hands[index].losses = lost.losses + 1

    def _check(self) -> None:
        """See that workers without a process may hope for one, until every one has had one."""
        waiting = [index for index, hand in enumerate(self._hands) if not hand.answered and not hand.losses]
        if not waiting:
            return
        waited_s = time.monotonic() - self._hands[waiting[0]].since
        if waited_s > WARN_S and not self._warned:
            log.warning("engine 'ray': rollout worker %d waits for a free processor", waiting[0] + 1)
            self._warned = True
        if waited_s > WAIT_S:
            raise InputError(
                f"engine 'ray': no processor of the cluster was free for rollout worker {waiting[0] + 1} for "
                f"{WAIT_S:.0f} s, expected one for each of the {len(self._hands)} workers"
            )

    def tell(self, news: News) -> None:
        """As of `WorkerPool`."""
        self._post.renew(news)

    def close(self) -> None:
        """As of `WorkerPool`."""
        for hand in self._hands:
            self._end(hand)

    def _end(self, hand: _RemoteWorker) -> None:
        import ray

        ray.kill(hand.actor)


def _writable(gathered: Gathered) -> Gathered:
    """What Ray hands over cannot be written, which torch does not like."""
    copied = [
        one._replace(
            observation=np.array(one.observation),
            step=one.step._replace(next_observation=np.array(one.step.next_observation)),
        )
        for one in gathered.experience
    ]
    return gathered._replace(experience=copied)

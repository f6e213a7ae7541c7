"""Rollout workers, in the learner's process or in processes of their own."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from multiprocessing.connection import Connection, wait
from typing import Protocol

import torch

from nathlon.policies.hosting.incoming import UnreadableError
from nathlon.policies.hosting.spawned import FreshProcesses, Spawned, obey_parent
from nathlon.policies.patience import LOOK_S
from nathlon.policies.training.worker import Gathered, News, RolloutWorker, WorkerSetup
from nathlon.sim.errors import InputError

STEPS_AHEAD = 2
"""Steps that a worker may be ahead of what the learner has taken in."""

Take = list[tuple[int, Gathered | None]]
"""By worker what a step of it brought; None where it is another one from here on, with races of its own."""


class WorkerPool(Protocol):
    """Rollout workers."""

    def take(self, wait_for_one: bool) -> Take:
        """The steps done since the last call, with the index of the worker of each, in its order.

        Args:
            wait_for_one: whether there must be at least one.

        Raises:
            InputError: if a worker cannot work, or has ended.
        """

    def tell(self, news: News) -> None:
        """What all workers shall know from their next steps on."""

    def close(self) -> None:
        """End the workers."""


MakeWorkers = Callable[[WorkerSetup], WorkerPool]
"""Starts the workers of a configuration."""


def local_workers(setup: WorkerSetup) -> WorkerPool:
    """Workers on this machine: processes, as many as the configuration says, or this one."""
    return ProcessWorkers(setup) if setup.config.workers else LocalWorkers(RolloutWorker(setup))


class LocalWorkers:
    """One worker in this process, which steps whenever it is waited for."""

    def __init__(self, worker: RolloutWorker) -> None:
        self._worker = worker

    def take(self, wait_for_one: bool) -> Take:
        return [(0, self._worker.step())] if wait_for_one else []

    def tell(self, news: News) -> None:
        self._worker.hear(news)

    def close(self) -> None:
        pass


class ProcessWorkers:
    """Workers in processes of their own, which go on stepping until they are `STEPS_AHEAD`."""

    def __init__(self, setup: WorkerSetup) -> None:
        """Start the processes, as many as the configuration says."""
        self._workers = [
            Spawned(FreshProcesses(), _serve, setup._replace(seed=stream))
            for stream in setup.seed.spawn(setup.config.workers)
        ]
        # Sent by a thread: a worker that waits until its own message is read takes in none.
        self._sender = ThreadPoolExecutor(1)
        self._news: dict[int, News] = {}
        for index in range(setup.config.workers):
            for _ in range(STEPS_AHEAD):
                self._ask(index)

    def _ask(self, index: int) -> None:
        self._sender.submit(self._workers[index].pipe.send, self._news.pop(index, None))

    def _ended(self, index: int) -> InputError:
        process = self._workers[index].process
        process.join(1.0)
        return InputError(f"training: rollout worker {index + 1} ended with exit code {process.exitcode}")

    def take(self, wait_for_one: bool) -> Take:
        taken: Take = []
        while True:
            for index, worker in enumerate(self._workers):
                try:
                    for message in islice(worker.incoming.messages(), 1):
                        if isinstance(message, InputError):
                            raise message
                        taken.append((index, message))
                        self._ask(index)
                except (EOFError, OSError):
                    raise self._ended(index) from None
                except UnreadableError as error:
                    raise InputError(
                        f"training: rollout worker {index + 1} sends what cannot be read: {error}"
                    ) from error
            if taken or not wait_for_one:
                return taken
            wait([worker.pipe for worker in self._workers], LOOK_S)

    def tell(self, news: News) -> None:
        self._news = dict.fromkeys(range(len(self._workers)), news)

    def close(self) -> None:
        for worker in self._workers:
            worker.kill()
        self._sender.shutdown()  # what was to be sent to the ended fails
        for worker in self._workers:
            worker.pipe.close()


def _serve(pipe: Connection, setup: WorkerSetup) -> None:
    obey_parent()
    torch.set_num_threads(1)
    try:
        worker = RolloutWorker(setup)
    except InputError as error:
        pipe.send(error)
        return
    try:
        while True:
            fresh = pipe.recv()
            if fresh is not None:
                worker.hear(fresh)
            pipe.send(worker.step())
    except (EOFError, OSError):
        return

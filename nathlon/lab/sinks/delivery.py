"""Delivering a night: each sink in a process of its own, which is ended if it takes too long."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple

from nathlon.policies.hosting.programs import Program, end, start
from nathlon.results.part import ResultModel
from nathlon.sim.process import command_of

CHAMPION = "champion"
"""The sink of a gate: the registry of MLflow."""
TRACKERS = ("wandb", "mlflow", "tensorboard")
"""Sinks that take what lies in the folder of a night."""
DEADLINE_S = 180.0
"""For all sinks together: they deliver at the same time."""


class Delivery(NamedTuple):
    """What became of a night in a sink.

    Attributes:
        place: where it is to be found; None where it could not be delivered.
        error: why, in a sentence without a full stop.
    """

    sink: str
    place: str | None
    error: str | None

    @property
    def sentence(self) -> str:
        """What is to be said after others of one that failed; '' of one that did not."""
        return f" Not delivered to {self.sink}: {self.error}." if self.error else ""


def deliver(told: ResultModel, sinks: Mapping[str, str]) -> tuple[Delivery, ...]:
    """Deliver a bulletin or promotion to sinks, addresses by name; none of them can raise or hang.

    What trackers print and leave behind stays in their processes.
    """
    content = told.model_dump(mode="json")
    try:
        # Processes end before the threads that wait for them do.
        with ThreadPoolExecutor(max(len(sinks), 1)) as threads, ExitStack() as stack:
            started = [stack.enter_context(_process(sink)) for sink in sinks]
            jobs = [[content, address] for address in sinks.values()]
            return tuple(threads.map(_answer, sinks, started, jobs))
    except OSError as error:  # no room for more processes
        return tuple(Delivery(sink, None, error.strerror or str(error)) for sink in sinks)


@contextmanager
def _process(sink: str) -> Iterator[Program]:
    # What a library complains of may hold a secret.
    process = start(
        command_of("nathlon.lab.sinks", sink),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            end(process)


def _answer(sink: str, process: Program, job: list[Any]) -> Delivery:
    try:
        said, _ = process.communicate(json.dumps(job).encode(), DEADLINE_S)
        place, error = json.loads(said)
    except subprocess.TimeoutExpired:
        return Delivery(sink, None, f"no answer within {DEADLINE_S:g} s")
    except (OSError, ValueError):
        return Delivery(sink, None, "its process has ended without an answer")
    return Delivery(sink, place, error)

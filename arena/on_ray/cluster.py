"""Joining a Ray cluster, and the nodes that it has now."""

from __future__ import annotations

import logging
import os
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from nathlon.sim.errors import InputError
from nathlon.sim.extras import need

AUTO = "auto"
"""Address of the cluster that this machine is part of."""
CONNECT_S = 5.0
"""For somebody to answer at an address."""
SILENT = "RAY_BACKEND_LOG_LEVEL", "fatal"
"""What keeps the lines of Ray's own threads out of the terminal: a node that is lost brings hundreds. They
stay in Ray's folder."""
VERSIONS = re.compile(r"Ray: (\S+)\s+Python: (\S+)")


class RayNode(NamedTuple):
    """A node that may have an actor.

    Attributes:
        id: that Ray knows it by.
        name: for people.
        processors: how many Ray may use there.
    """

    id: str
    name: str
    processors: int


@contextmanager
def joined(address: str) -> Iterator[None]:
    """Take part in a Ray cluster; a process that does already stays in its own.

    Raises:
        InputError: if Ray is not installed, nobody answers at the address, or versions differ.
    """
    need("ray", "ray", "engine 'ray'")
    import ray

    if ray.is_initialized():
        yield
        return
    try:
        _knock(address)
        os.environ.setdefault(*SILENT)
        with _silent():  # it says that it will say nothing
            # Never one of its own, which could outlive this process.
            ray.init(address, job_config=_job(), log_to_driver=False, logging_level=logging.ERROR)
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"engine_address is {address!r}: {refusal(str(error), ray.__version__)}") from None
    try:
        yield
    finally:
        ray.shutdown()


@contextmanager
def _silent() -> Iterator[None]:
    """Without what is written to standard error, from below Python too."""
    kept = os.dup(2)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def refusal(said: str, here: str) -> str:
    """Why a cluster cannot be joined, from what Ray says of it; `here` is the version of this machine."""
    versions = VERSIONS.findall(said)
    if "Version mismatch" in said and len(versions) == 2:
        (theirs, their_python), (ours, our_python) = versions
        return (
            f"the cluster has Ray {theirs} and Python {their_python}, this machine Ray {ours} and Python "
            f"{our_python}; expected the same versions on all machines"
        )
    # What it asks for is not how it is said here.
    reason = " ".join(said.partition("Please")[0].split()).rstrip(".")
    return (
        f"{reason}; expected a Ray cluster with the Ray {here} and the Python of this machine, and "
        "RAY_AUTH_MODE=token if it asks for a token"
    )


def _job() -> Any:
    """What Ray is told of this process: not the current folder, from which its workers would import."""
    from ray.job_config import JobConfig

    class Job(JobConfig):
        def _serialize(self) -> Any:
            self._py_driver_sys_path.clear()
            return super()._serialize()

    return Job()


def _knock(address: str) -> None:
    """See that somebody answers: Ray tries for minutes, and says much meanwhile."""
    host, _, port = address.rpartition("/")[2].rpartition(":")
    if host and port.isdigit():
        socket.create_connection((host, int(port)), CONNECT_S).close()


def places() -> dict[str, RayNode]:
    """The nodes that are there and have processors, by their ids."""
    import ray

    found = [
        RayNode(node["NodeID"], node["NodeManagerHostname"], int(node["Resources"].get("CPU", 0)))
        for node in ray.nodes()
        if node["Alive"]
    ]
    return {place.id: place for place in found if place.processors}

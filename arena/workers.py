"""One process that runs matches, as the process that started it sees it."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache
from multiprocessing import current_process, forkserver, get_all_start_methods, get_context
from multiprocessing.connection import Connection
from tempfile import TemporaryDirectory
from typing import Any

from nathlon.arena.output_log import OutputLog
from nathlon.arena.watch import TOLD, Patience, Watch
from nathlon.policies.hosting.incoming import UnreadableError
from nathlon.policies.hosting.spawned import Spawned, starting_processes
from nathlon.policies.isolation import CLOSED
from nathlon.policies.sources import DRIVER
from nathlon.sim.scratch import scratch_folder

NO_MEMORY = 71
"""With what a worker exits that has run out of memory."""
READY = "ready"
"""What a worker sends when it waits for something to do."""

_CONTEXT: Any = get_context("forkserver" if "forkserver" in get_all_start_methods() else "spawn")
# Threads that polars starts as it is imported wait for work, and hold nothing that a fork would leave locked.
_CONTEXT.set_forkserver_preload(["nathlon.policies.preloaded", "nathlon.arena.serving"])
LONGEST_FOLDER = 80
"""Letters in the path of a folder for sockets: those of a socket are limited."""


def need_worker(sources: Iterable[str]) -> bool:
    """Whether matches of these policies need a process of their own: built-in drivers can harm none."""
    return any(source.partition(":")[0] != DRIVER for source in sources)


def start_server() -> None:
    """Have what all workers need loaded while this process does something else.

    The process that they are forked from begins with it at once, and not when the first worker starts.
    To be called from the main thread.
    """
    if _CONTEXT.get_start_method() == "forkserver":
        # Ctrl-C is for this process to answer; that one would print where it was interrupted.
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)
        _sockets_folder()
        try:
            with starting_processes():
                forkserver.ensure_running()
        finally:
            signal.signal(signal.SIGINT, before)


@cache
def _sockets_folder() -> TemporaryDirectory[str]:
    """Where this process's socket for the server lies: removed also if this process is killed."""
    folder = scratch_folder()
    if len(folder.name) <= LONGEST_FOLDER:
        # `multiprocessing` makes a folder where none is set, and leaves it behind when it is killed.
        own: Any = current_process()
        own._config.setdefault("tempdir", folder.name)
    return folder


def new_output_log() -> OutputLog:
    """A log that workers can print into."""
    return OutputLog(lambda: _CONTEXT.Pipe(duplex=False))


class Worker(Spawned):
    """A process that runs matches.

    Attributes:
        watch: what it is at.
        patience: how long it has been so.
        idle: whether it waits for something to do.
        fresh: whether it has not been given anything yet.
        unreadable: whether it was ended for what it has sent: foreign code in it writes into the pipe, or has
            changed what was to be sent.
    """

    def __init__(
        self,
        serve: Callable[[Connection, Watch, Connection], None],
        sink: Connection,
        answer_s: float,
        first_answer_s: float,
        match_s: float,
    ) -> None:
        """Start a process that calls `serve`, printing into the sink of a log; see `Watch` for the times."""
        _sockets_folder()
        self.watch = Watch(answer_s, first_answer_s, match_s, _CONTEXT.RawArray("d", TOLD))
        self.idle, self.fresh, self.began, self.unreadable = False, True, False, False
        self._mute = False
        super().__init__(_CONTEXT, serve, self.watch, sink, limit_s=first_answer_s)
        self.patience = Patience(self.watch, self.process.pid)

    @property
    def signs(self) -> tuple[Any, ...]:
        """What becomes ready when it has news or has died; see `multiprocessing.connection.wait`."""
        # The end of a pipe is news for ever, and its process may live on for a while.
        return (self.process.sentinel,) if self._mute else (self.pipe, self.process.sentinel)

    @property
    def dead(self) -> bool:
        return not self.process.is_alive()

    @property
    def out_of_memory(self) -> bool:
        """Whether it has died for want of memory, which the system may have killed it for."""
        return self.process.exitcode in (NO_MEMORY, -signal.SIGKILL)

    @property
    def closed(self) -> bool:
        """Whether it has died because foreign code in it had closed what it answers through."""
        return self.process.exitcode == CLOSED

    def give(self, work: object) -> None:
        """Send it something to do; if it has died meanwhile, that is noticed later."""
        self.idle = self.fresh = False
        with suppress(BrokenPipeError):
            self.pipe.send(work)

    def news(self) -> Iterator[Any]:
        """What it has sent and was not read yet, READY apart."""
        try:
            for message in self.incoming.messages():
                if message == READY:
                    self.idle = self.began = True
                else:
                    yield message
        except (EOFError, OSError):
            self._mute = True  # it has died, or closed its end; what it was sending is lost
        except UnreadableError:
            self.unreadable = True
            self.kill()

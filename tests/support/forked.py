"""Commands and scripts in processes of their own, forked from one that has loaded what they all load.

A process that starts from nothing takes longer for that than for what it is started for. All share one server
of worker processes, as nothing of it is theirs.
"""

from __future__ import annotations

import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import traceback
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from types import ModuleType
from typing import IO, Any

ROOT = Path(__file__).parent.parent.parent
LARGEST = 1 << 20
"""Bytes of what is asked for, at most."""


class Forked:
    """A process, in the terms of `subprocess.Popen`; its output is to be read to the end."""

    def __init__(self, arguments: list[str], cwd: str | Path, environment: Mapping[str, str]) -> None:
        """Start it.

        Args:
            arguments: `-c` and a script, or those of `nathlon`.
            cwd: the folder that it is in.
            environment: variables that it has besides those of this process.
        """
        out, err = os.pipe(), os.pipe()
        self._status, theirs = socket.socketpair()
        wanted = {"arguments": arguments, "cwd": str(cwd), "environment": {**os.environ, **environment}}
        socket.send_fds(_server(), [json.dumps(wanted).encode()], [theirs.fileno(), out[1], err[1]])
        for end in (theirs.detach(), out[1], err[1]):
            os.close(end)
        self.stdout: IO[str] = os.fdopen(out[0])
        self.stderr: IO[str] = os.fdopen(err[0])
        self.pid = int(self._status.recv(64))
        self.returncode: int | None = None

    def send_signal(self, number: int) -> None:
        os.kill(self.pid, number)

    def wait(self) -> int:
        """Wait for its end; the exit code, or the signal's number less than 0."""
        if self.returncode is None:
            self.returncode = int(self._status.recv(64))
            self._status.close()
        return self.returncode

    def communicate(self) -> tuple[str, str]:
        """Wait for its end; what it has printed and complained of."""
        with self.stdout, self.stderr, DefaultSelector() as selector:
            said: dict[Any, list[bytes]] = {self.stdout: [], self.stderr: []}
            for stream in said:
                selector.register(stream, EVENT_READ)
            while selector.get_map():
                for key, _ in selector.select():
                    part = os.read(key.fd, 1 << 16)
                    said[key.fileobj].append(part)
                    if not part:
                        selector.unregister(key.fileobj)
        self.wait()
        printed, complained = (b"".join(parts).decode() for parts in said.values())
        return printed, complained


def start(*arguments: str | Path, cwd: str | Path, **environment: str) -> Forked:
    """Start a command of `nathlon`, or a script as `-c SCRIPT ARGUMENT ...`; see `Forked`."""
    return Forked([str(argument) for argument in arguments], cwd, environment)


def run(*arguments: str | Path, cwd: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Start one and wait for its end; see `start`."""
    process = start(*arguments, cwd=cwd, **environment)
    printed, complained = process.communicate()
    return subprocess.CompletedProcess(arguments, process.wait(), printed, complained)


@cache
def _server() -> socket.socket:
    """The process from which all are forked; it ends with this one."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    command = [sys.executable, "-m", "tests.support.forked", str(theirs.fileno())]
    subprocess.Popen(command, cwd=ROOT, pass_fds=[theirs.fileno()])
    theirs.close()
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LARGEST)
    return ours


def _serve(asked: socket.socket) -> None:
    from multiprocessing import forkserver

    from nathlon.arena.entrant import enter
    from nathlon.arena.workers import start_server

    for driver in ("driver", "driver:pace=0.9"):
        enter(driver, "lindenring", "gt3")
    start_server()
    # It is no child of those that are forked.
    forkserver.ensure_running = forkserver._forkserver.ensure_running = lambda: None  # type: ignore[method-assign]
    ended, awake = socket.socketpair()
    awake.setblocking(False)
    signal.set_wakeup_fd(awake.fileno())
    signal.signal(signal.SIGCHLD, lambda *_: None)
    running: dict[int, socket.socket] = {}
    with DefaultSelector() as selector:
        selector.register(asked, EVENT_READ)
        selector.register(ended, EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fileobj is ended:
                    ended.recv(1 << 10)
                    _tell_of_the_dead(running)
                    continue
                message, streams, _, _ = socket.recv_fds(asked, LARGEST, 3)
                if not message:
                    return
                _fork(json.loads(message), streams, running)


def _tell_of_the_dead(running: dict[int, socket.socket]) -> None:
    for pid in list(running):
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            with running.pop(pid) as status_of:
                status_of.send(str(os.waitstatus_to_exitcode(status)).encode())


def _fork(wanted: dict[str, Any], streams: list[int], running: dict[int, socket.socket]) -> None:
    told, out, err = streams
    pid = os.fork()
    if pid == 0:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        os.dup2(out, 1)
        os.dup2(err, 2)
        for stream in (told, out, err):
            os.close(stream)
        os._exit(_become(wanted))
    status = socket.socket(fileno=told)
    status.send(str(pid).encode())
    running[pid] = status
    os.close(out)
    os.close(err)


def _become(wanted: dict[str, Any]) -> int:
    """Do what is wanted; the exit code."""
    os.chdir(wanted["cwd"])
    os.environ.clear()
    os.environ.update(wanted["environment"])
    sys.path[:0] = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    arguments = wanted["arguments"]
    try:
        if arguments[0] == "-c":
            sys.argv = ["-c", *arguments[2:]]
            main = sys.modules["__main__"] = ModuleType("__main__")
            exec(compile(arguments[1], "<string>", "exec"), main.__dict__)
        else:
            sys.argv = ["nathlon", *arguments]
            runpy.run_module("nathlon.cli", run_name="__main__")
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
        code = 1
    else:
        code = 0
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    return code if isinstance(code, int) else int(code is not None)


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))

"""Rerun's own viewer with a replay, drawn without a window, for pictures and for tests of what it shows."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from rerun.experimental import ViewerClient

from nathlon.reports._blueprint import TIMELINE
from nathlon.sim.errors import InputError

RERUN = Path(sys.executable).with_name("rerun")
PATIENCE_S = 120.0


@contextmanager
def paused_viewer(replay: Path, at_s: float, size: str = "1200x800") -> Iterator[ViewerClient]:
    """The viewer with a replay that stands still at a moment, in a window of so many pixels.

    Raises:
        InputError: if no Vulkan driver is installed.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    window = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", size]
    with TemporaryFile("w+") as said:
        process = subprocess.Popen([RERUN, *window, replay], stdout=said, stderr=said, start_new_session=True)
        try:
            until = time.monotonic() + PATIENCE_S
            while (client := _loaded(f"rerun+http://127.0.0.1:{port}/proxy")) is None:
                if process.poll() is not None:
                    said.seek(0)
                    raise _why_not(said.read())
                assert time.monotonic() < until, "the viewer does not answer"
                time.sleep(0.2)
            client.set_time(TIMELINE, duration=at_s, play_state="paused")
            settled(client.take_screenshot)
            yield client
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def settled(take: Callable[[], bytes]) -> bytes:
    """A picture that is like the one before: cameras take a moment to arrive."""
    until, before = time.monotonic() + PATIENCE_S, b""
    while (now := take()) != before:
        assert time.monotonic() < until, "the picture never comes to rest"
        before = now
    return now


def _loaded(url: str) -> ViewerClient | None:
    """A viewer that runs and has all of its replay."""
    try:
        client = ViewerClient.connect(url)
        state = client.get_state()
    except (ConnectionError, RuntimeError):
        return None
    return client if state.recordings and state.recordings[0].timelines and not state.loading else None


def _why_not(said: str) -> Exception:
    reason = re.search("No graphics adapter was found|Failed to get render context", said)
    if reason is None:
        return RuntimeError(said)
    return InputError(f"needs a Vulkan driver: apt-get install mesa-vulkan-drivers ({reason[0]})")

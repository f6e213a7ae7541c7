"""What Rerun's own viewer shows of a replay, drawn by it without a window."""

from __future__ import annotations

import io
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pygame
import pytest
from numpy.typing import NDArray
from rerun.experimental import ViewerClient

from nathlon.arena.circuit_mesh import KERB, ROAD
from nathlon.arena.foxglove_scene import TEAM_COLOURS
from nathlon.reports._blueprint import SKY, TIMELINE
from nathlon.reports._circuit import ZONE_COLOUR
from nathlon.reports.replay import DRAUGHT_COLOUR, MARK_COLOURS, write_replay
from tests.support.race_logs import oval_race

RERUN = Path(sys.executable).with_name("rerun")
PATIENCE_S = 120.0
MOMENT_S = 9.0
"""Soon after the contact of a race of 20 s, in the first bend."""
Picture = NDArray[np.uint8]


@pytest.fixture(scope="module")
def viewer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ViewerClient]:
    """The viewer with a race at MOMENT_S, from behind car 1."""
    replay = tmp_path_factory.mktemp("picture") / "race.rrd"
    write_replay(oval_race(cars=3, duration_s=20.0), replay, follow=1)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command: list[str | Path] = [
        RERUN,
        "--headless",
        "--bind",
        "127.0.0.1",
        "--port",
        str(port),
        "--window-size",
        "1200x800",
    ]
    said = replay.with_name("viewer.log")
    with said.open("w") as log:
        process = subprocess.Popen([*command, replay], stdout=log, stderr=log, start_new_session=True)
    try:
        until = time.monotonic() + PATIENCE_S
        while (client := _loaded(f"rerun+http://127.0.0.1:{port}/proxy")) is None:
            if process.poll() is not None:
                reason = re.search(
                    "No graphics adapter was found|Failed to get render context", said.read_text()
                )
                assert reason, said.read_text()
                pytest.skip(f"needs a Vulkan driver: apt-get install mesa-vulkan-drivers ({reason[0]})")
            assert time.monotonic() < until, "the viewer does not answer"
            time.sleep(0.2)
        client.set_time(TIMELINE, duration=MOMENT_S, play_state="paused")
        _settled(client.take_screenshot)
        yield client
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _loaded(url: str) -> ViewerClient | None:
    """A viewer that runs and has all of its replay."""
    try:
        client = ViewerClient.connect(url)
        state = client.get_state()
    except (ConnectionError, RuntimeError):
        return None
    return client if state.recordings and state.recordings[0].timelines and not state.loading else None


def _settled(take: Callable[[], bytes]) -> bytes:
    """A picture that is like the one before: cameras take a moment to arrive."""
    until, before = time.monotonic() + PATIENCE_S, b""
    while (now := take()) != before:
        assert time.monotonic() < until, "the picture never comes to rest"
        before = now
    return now


def picture(viewer: ViewerClient, kind: str) -> Picture:
    """The first view of a kind as pixels (height, width, 3)."""
    [view] = [view for view in viewer.get_state().views if f"{view.view_class} {view.name}".startswith(kind)]
    image = pygame.image.load(io.BytesIO(viewer.take_screenshot(view.view_id)), "view.png")
    return pygame.surfarray.array3d(image).swapaxes(0, 1)


def share(pixels: Picture, colour: tuple[int, int, int], within: int = 12) -> float:
    """Share of pixels of about this colour."""
    return float((np.abs(pixels.astype(int) - colour).max(axis=2) <= within).mean())


def test_no_view_complains(viewer: ViewerClient) -> None:
    views = viewer.get_state().views
    assert len(views) == 11
    assert [(view.name, view.reports) for view in views if view.reports] == []
    assert [entry for entry in viewer.get_logs() if entry.level == "ERROR"] == []


def test_the_race_is_seen_from_behind_the_car(viewer: ViewerClient) -> None:
    scene = picture(viewer, "3D Behind 1 entrant b")
    height, width, _ = scene.shape
    assert share(scene[: height // 10], SKY) > 0.9
    assert share(scene, ROAD) > 0.15
    for stripe in KERB:
        assert share(scene, stripe, 25) > 0.001
    car = scene[height // 2 : height * 4 // 5, width * 2 // 5 : width * 3 // 5]
    red, green, blue = (round(0.7 * part) for part in TEAM_COLOURS[1])
    assert share(car, (red, green, blue)) > 0.05
    assert share(scene, DRAUGHT_COLOUR) > 0.0002


def test_the_map_shows_zone_cars_and_marks(viewer: ViewerClient) -> None:
    drawn = picture(viewer, "2D")
    for colour in (ZONE_COLOUR, TEAM_COLOURS[0], TEAM_COLOURS[1], MARK_COLOURS["contact"]):
        assert share(drawn, colour, 20) > 0.0001, colour


@pytest.mark.parametrize(
    ("kind", "colours"),
    [
        ("TimeSeries Speed", (TEAM_COLOURS[1], MARK_COLOURS["contact"])),
        ("TimeSeries Throttle", ((90, 200, 90), DRAUGHT_COLOUR)),
        ("TimeSeries Steering", ((200, 200, 120),)),
        ("TimeSeries Places", (TEAM_COLOURS[0], TEAM_COLOURS[1], MARK_COLOURS["contact"])),
        ("TimeSeries Gap", (TEAM_COLOURS[0], TEAM_COLOURS[1])),
        ("TextLog", (MARK_COLOURS["contact"],)),
    ],
)
def test_series_and_list_are_drawn(
    viewer: ViewerClient, kind: str, colours: tuple[tuple[int, int, int], ...]
) -> None:
    drawn = picture(viewer, kind)
    for colour in colours:
        assert share(drawn, colour, 40) > 0.0003, colour

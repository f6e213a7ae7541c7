"""What Rerun's own viewer shows of a replay, drawn by it without a window."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pygame
import pytest
from numpy.typing import NDArray
from rerun.experimental import ViewerClient

from benchmarks.replay_viewer import paused_viewer
from nathlon.arena.circuit_mesh import KERB, ROAD
from nathlon.arena.foxglove_scene import TEAM_COLOURS
from nathlon.reports._blueprint import SKY
from nathlon.reports._circuit import ZONE_COLOUR
from nathlon.reports.replay import DRAUGHT_COLOUR, MARK_COLOURS, write_replay
from nathlon.sim.errors import InputError
from tests.support.race_logs import oval_race

MOMENT_S = 9.0
"""Soon after the contact of a race of 20 s, in the first bend."""
Picture = NDArray[np.uint8]


@pytest.fixture(scope="module")
def viewer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ViewerClient]:
    """The viewer with a race at MOMENT_S, from behind car 1."""
    replay = tmp_path_factory.mktemp("picture") / "race.rrd"
    write_replay(oval_race(cars=3, duration_s=20.0), replay, follow=1)
    with ExitStack() as stack:
        try:
            viewer = stack.enter_context(paused_viewer(replay, MOMENT_S))
        except InputError as error:
            pytest.skip(str(error))
        yield viewer


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
    scene = picture(viewer, "3D Behind 2 entrant b")
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

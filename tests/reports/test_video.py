"""A clip is a video of the race, as another decoder reads it."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.arena.foxglove_scene import TEAM_COLOURS
from nathlon.arena.race_log import RaceLog
from nathlon.reports._video_panels import MAP, MARGIN, brief
from nathlon.reports.video import ALARM, RATE, SIZE, pictures, write_video
from nathlon.sim.errors import InputError
from tests.support.race_logs import oval_race


@pytest.fixture(scope="module")
def log() -> RaceLog:
    return oval_race(cars=3, duration_s=20.0)


def frames(path: Path) -> list[NDArray[np.uint8]]:
    with av.open(str(path)) as container:
        assert container.streams.video[0].average_rate == RATE
        return [np.asarray(frame.to_ndarray(format="rgb24"), np.uint8) for frame in container.decode(video=0)]


def test_it_has_a_picture_for_every_moment(tmp_path: Path, log: RaceLog) -> None:
    assert write_video(log, tmp_path / "clip.mp4", 1, 4.0, 4.5) == 15
    found = frames(tmp_path / "clip.mp4")
    assert len(found) == 15
    assert found[0].shape == (SIZE[1], SIZE[0], 3)
    drawn = list(pictures(log, 1, 4.0 + np.arange(15) / RATE))
    assert np.abs(found[-1].astype(int) - drawn[-1]).mean() < 6.0
    assert np.abs(drawn[0].astype(int) - drawn[-1]).mean() > 1.0
    assert [path.name for path in tmp_path.iterdir()] == ["clip.mp4"]


@pytest.mark.parametrize("car", [0, 1])
def test_the_followed_car_stands_in_the_middle(log: RaceLog, car: int) -> None:
    [picture] = pictures(log, car, np.array([6.0]))
    middle = picture[SIZE[1] // 2 - 30 : SIZE[1] // 2 + 30, SIZE[0] // 2 - 30 : SIZE[0] // 2 + 30]
    colour = np.array(TEAM_COLOURS[log.teams[car]])
    assert (np.abs(middle.astype(int) - colour).max(axis=2) < 12).sum() > 40


def test_cars_in_contact_are_ringed(log: RaceLog) -> None:
    contact_s = log.incidents[0].time_s
    before, after = pictures(log, 1, np.array([contact_s - 0.2, contact_s + 0.2]))
    ring = [(np.abs(picture.astype(int) - ALARM).max(axis=2) < 12).sum() for picture in (before, after)]
    assert ring[0] == 0
    assert ring[1] > 200


def test_the_map_shows_where_the_cars_are(log: RaceLog) -> None:
    early, late = pictures(log, 0, np.array([0.1, 9.0]))
    corner = (slice(-MARGIN - MAP[1], -MARGIN), slice(-MARGIN - MAP[0], -MARGIN))
    blue = [
        np.argwhere(np.abs(picture[corner].astype(int) - TEAM_COLOURS[0]).max(axis=2) < 12).mean(axis=0)
        for picture in (early, late)
    ]
    # From the middle of the south straight into the bend in the east.
    np.testing.assert_allclose(blue[0][1], MAP[0] / 2, atol=4)
    assert blue[1][1] > MAP[0] * 0.8
    assert blue[1][0] < blue[0][0]


def test_names_leave_out_how_all_of_them_begin() -> None:
    assert brief(["lindenring-s1-020k", "lindenring-s1-024k"]) == ["1 020k", "2 024k"]
    assert brief(["driver:pace=0.95", "driver:pace=0.9", "driver:pace=1"]) == ["1 0.95", "2 0.9", "3 1"]
    assert brief(["a-b", "a-b"]) == ["1 a-b", "2 a-b"]
    assert brief(["a-b", "a-b-c", ""]) == ["1 a-b", "2 a-b-c", "3 "]
    [long, _] = brief(["a-very-long-name-of-a-checkpoint-040k", "driver"])
    assert long == "1 a-very-l…oint-040k"


def test_there_is_no_clip_of_nothing(tmp_path: Path, log: RaceLog) -> None:
    for start, end in ((30.0, None), (5.0, 5.0), (8.0, 3.0)):
        with pytest.raises(InputError, match=r"clip\.mp4: no clip from .* expected times from 0 to 19\.9 s"):
            write_video(log, tmp_path / "clip.mp4", None, start, end)
    with pytest.raises(InputError, match="cannot be written"):
        write_video(log, tmp_path / "missing" / "clip.mp4", None, 0.0, 0.1)
    assert list(tmp_path.iterdir()) == []

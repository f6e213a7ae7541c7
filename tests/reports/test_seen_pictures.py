"""What cars with cameras saw is shown beside their races, as it was."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from nathlon.arena.entrant import enter
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recorder import record_races
from nathlon.arena.recording import read_recording, write_recording
from nathlon.arena.single_race import single_race
from nathlon.policies.checkpoint import SeeingPolicy, save_checkpoint
from nathlon.policies.driver import Driver
from nathlon.reports.race_data import MOST_SIGHTS, race_data
from nathlon.reports.replay import log_race
from nathlon.reports.seen_pictures import camera_of, seen_pictures
from nathlon.reports.video import pictures
from tests.policies.test_vision import SPEC, card, tensors
from tests.support.race_logs import oval_race


class Raced(NamedTuple):
    """A race, the car that sees, and what its policy was shown, (n, height, width, 3)."""

    log: RaceLog
    car: int
    shown: np.ndarray


@pytest.fixture(scope="module")
def raced(tmp_path_factory: pytest.TempPathFactory) -> Raced:
    path = tmp_path_factory.mktemp("eye") / "eye.safetensors"
    save_checkpoint(path, tensors(card()), card())
    shown: list[np.ndarray] = []

    class Watched(SeeingPolicy):
        def act(self, observations: Any, memory: Any) -> Any:
            shown.append(observations["picture"][0].copy())
            return super().act(observations, memory)

    entrants = [enter(source, "lindenring", "gt3") for source in (str(path), "driver")]
    match = single_race(entrants, "slipstream_pass", seed=1)
    policies: list[Any] = [Watched(card(), "eye", tensors(card())), Driver("lindenring", "gt3")]
    log = record_races(match, policies, [0], ["eye", "driver"]).logs[0]
    return Raced(log, log.names.index("eye"), np.stack(shown))


def test_a_picture_taken_from_the_log_is_what_the_policy_was_shown(raced: Raced) -> None:
    log, car, shown = raced
    assert [camera_of(log, car), camera_of(log, 1 - car)] == [SPEC.camera, None]
    count = min(len(shown), len(log.time_s)) - 1
    again = seen_pictures(log, car, log.time_s[:count])
    differs = np.abs(again.astype(int) - shown[:count]).max(axis=3) > 12
    # Places are rounded in the log, so that some edges fall into the next pixel.
    assert differs.mean() < 0.02
    assert np.abs(np.diff(shown[:count].astype(int), axis=0)).max() > 100  # it did move


def test_recordings_keep_by_what_camera_somebody_saw(raced: Raced, tmp_path: Path) -> None:
    write_recording(tmp_path / "race.mcap", raced.log)
    assert read_recording(tmp_path / "race.mcap").cameras == raced.log.cameras
    write_recording(tmp_path / "oval.mcap", oval_race(cars=2, duration_s=2.0))
    assert read_recording(tmp_path / "oval.mcap").cameras == ()


def test_pages_replays_and_videos_show_it(raced: Raced) -> None:
    log, car, _ = raced
    [sight] = race_data(log)["sights"]
    assert (sight["car"], sight["width"], sight["height"]) == (car, 40, 36)
    assert 10 < sight["count"] <= MOST_SIGHTS
    for followed, there in ((car, True), (1 - car, False)):
        stream = Stream()
        log_race(stream, log, followed)  # type: ignore[arg-type]
        assert ("seen" in stream.sent) is there
    corners = [next(pictures(log, one, log.time_s[20:21]))[400:600, 20:200] for one in (car, 1 - car)]
    assert len(np.unique(corners[0].reshape(-1, 3), axis=0)) > 8
    assert (corners[0] != corners[1]).mean() > 0.3


class Stream:
    """Notes where something is logged."""

    def __init__(self) -> None:
        self.sent: set[str] = set()

    def log(self, entity: str, *_: Any, **__: Any) -> None:
        self.sent.add(entity)

    def send_columns(self, entity: str, *_: Any, **__: Any) -> None:
        self.sent.add(entity)

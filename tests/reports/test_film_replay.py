"""A film as others read it: Rerun's own tools, and another decoder of its video."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image
from rerun.chunk import RrdReader

from nathlon.arena.film import Film
from nathlon.reports.film_replay import TIMELINE, write_film_replay
from nathlon.reports.film_video import LAST_S, write_film_video
from tests.support.games import refused


def jpeg(level: int) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (61, 41), (level, level, level)).save(file, "JPEG")
    return file.getvalue()


FILM = Film(
    world="w",
    scenario="duel",
    match="m" * 64,
    race=3,
    seed=1,
    version="0",
    seats=(("left", "a"), ("right", "b")),
    time_s=(0.0, 0.5, 1.0, 3.0),
    pictures=tuple(map(jpeg, (0, 80, 160, 240))),
)


def test_rerun_finds_every_picture_at_its_time(tmp_path: Path) -> None:
    path = tmp_path / "film.rrd"
    write_film_replay(FILM, path)
    [chunk] = [chunk for chunk in RrdReader(path).stream() if chunk.entity_path == "/pictures"]
    batch = chunk.to_record_batch()
    columns = dict(zip(batch.schema.names, batch.columns, strict=True))
    assert (columns[TIMELINE].to_numpy() / np.timedelta64(1, "s")).tolist() == list(FILM.time_s)
    assert [bytes(row[0]) for row in columns["EncodedImage:blob"].to_pylist()] == list(FILM.pictures)
    assert columns["EncodedImage:media_type"].to_pylist() == [["image/jpeg"]] * 4
    [blueprint] = RrdReader(path).blueprints()
    assert blueprint.application_id == "nathlon"


def test_a_video_shows_every_picture_for_its_time_and_the_last_one_longer(tmp_path: Path) -> None:
    path = tmp_path / "film.webm"
    write_film_video(FILM, path)
    with av.open(str(path)) as video:
        frames = list(video.decode(video=0))
        assert video.streams.video[0].codec_context.name in ("vp9", "libvpx-vp9")
    assert [round(float(frame.time), 3) for frame in frames] == [*FILM.time_s, FILM.time_s[-1] + LAST_S]
    pictures = [np.asarray(frame.to_ndarray(format="rgb24")) for frame in frames]
    assert pictures[0].shape == (42, 62, 3), "encoders want even ones"
    assert [picture.mean() for picture in pictures] == pytest.approx([0, 80, 160, 240, 240], abs=4)


def test_what_cannot_be_made_a_video_is_refused(tmp_path: Path) -> None:
    with refused("the video cannot be written"):
        write_film_video(replace(FILM, pictures=(jpeg(0)[:300],) * 4), tmp_path / "film.webm")
    assert not list(tmp_path.iterdir())

"""Films of episodes: few and small pictures, in MCAP files that any reader reads."""

from __future__ import annotations

import io
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray
from PIL import Image

from nathlon.arena import film as film_module
from nathlon.arena.film import SIDE, Film, FilmCamera
from nathlon.arena.film_recording import holds_film, read_film, write_film
from nathlon.arena.mcap_file import is_schema_of
from nathlon.arena.recording import write_recording
from nathlon.arena.world import WorldError
from tests.support.games import refused
from tests.support.race_logs import oval_race


def grey(level: int, height: int = 40, width: int = 60) -> NDArray[np.uint8]:
    return np.full((height, width, 3), level, np.uint8)


def filmed(steps: int, step_s: float) -> FilmCamera:
    camera = FilmCamera()
    for step in range(steps):
        camera(step * step_s, partial(grey, step % 256), step == steps - 1)
    return camera


def film(camera: FilmCamera) -> Film:
    seats = (("left", "a"), ("right", "b <&"))
    return Film(
        "w", "duel", "m" * 64, 3, 7, "0", seats, tuple(camera.time_s), tuple(camera.pictures), camera.note
    )


def test_a_picture_is_taken_every_step_but_not_more_than_thirty_a_second() -> None:
    assert filmed(5, 0.5).time_s == [0.0, 0.5, 1.0, 1.5, 2.0]
    quick = filmed(101, 0.01)
    assert quick.time_s == pytest.approx([*np.arange(0.0, 1.0, 0.04), 1.0])
    assert quick.note == ""


def test_what_is_not_wanted_is_not_drawn() -> None:
    drawn: list[int] = []
    camera = FilmCamera()

    def draw() -> NDArray[np.uint8]:
        drawn.append(step)
        return grey(0)

    for step in range(10):
        camera(step / 100, draw, step == 9)
    assert drawn == [0, 4, 8, 9]


def test_a_long_film_keeps_its_end_and_says_that_it_was_thinned_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film_module, "MOST_PICTURES", 20)
    camera = filmed(100, 0.1)
    assert 10 <= len(camera.pictures) <= 20
    assert camera.time_s[-1] == pytest.approx(9.9)
    assert np.diff(camera.time_s)[:-1] == pytest.approx(0.8)
    assert camera.note.startswith("It has a picture every 0.8 s, as more than 20 pictures")


def test_large_pictures_are_made_smaller() -> None:
    camera = FilmCamera()
    camera(0.0, lambda: grey(9, 3 * SIDE, 2 * SIDE), True)
    assert Image.open(io.BytesIO(camera.pictures[0])).size == (427, SIDE)


@pytest.mark.parametrize(
    "drawn", [None, np.zeros((4, 4)), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), np.uint8)]
)
def test_what_is_no_picture_is_the_world_s_fault(drawn: object) -> None:
    with pytest.raises(
        WorldError, match=r"render gives .*, expected a picture \(height, width, 3\) of uint8"
    ):
        FilmCamera()(0.0, lambda: drawn, True)


def test_an_independent_reader_finds_every_picture_at_its_time(tmp_path: Path) -> None:
    camera = filmed(30, 0.25)
    path = tmp_path / "film.mcap"
    write_film(path, film(camera))
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        messages = list(reader.iter_decoded_messages())
        [metadata] = reader.iter_metadata()
    assert metadata.metadata["scenario"] == "duel"
    times = [message.log_time for _, _, message, _ in messages]
    assert times == [round(0.25e9 * step) for step in range(30)]
    for step, (schema, channel, message, image) in enumerate(messages):
        assert schema is not None
        assert (schema.name, channel.topic) == ("foxglove.CompressedImage", "/pictures")
        assert is_schema_of(CompressedImage, schema)
        assert image.format == "jpeg"
        assert image.timestamp.ToNanoseconds() == message.log_time
        picture = np.asarray(Image.open(io.BytesIO(image.data)))
        assert picture.shape == (40, 60, 3)
        assert abs(int(picture.mean()) - step) <= 1


def test_a_film_reads_back_and_gives_the_same_bytes(tmp_path: Path) -> None:
    one, path = film(filmed(5, 0.25)), tmp_path / "film.mcap"
    write_film(path, one)
    assert read_film(path) == one
    before = path.read_bytes()
    write_film(path, read_film(path))
    assert path.read_bytes() == before
    assert holds_film(path)


def test_what_is_no_film_is_refused(tmp_path: Path) -> None:
    race, path = tmp_path / "race.mcap", tmp_path / "film.mcap"
    write_recording(race, oval_race(cars=1, duration_s=1.0))
    assert not holds_film(race)
    with refused("it has no picture"):
        read_film(race)
    write_film(path, film(filmed(5, 0.1)))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with refused("is cut short or damaged"):
        read_film(path)
    large = Film("w", "s", "m", 0, 0, "0", (), (0.0,), (jpeg(SIDE + 1),))
    write_film(path, large)
    with refused(f"expected at most {SIDE}"):
        read_film(path)
    write_film(path, Film("w", "s", "m", 0, 0, "0", (), (0.0, 0.0), (jpeg(4), jpeg(4))))
    with refused("its times do not increase"):
        read_film(path)
    write_film(path, Film("w", "s", "m", 0, 0, "0", (), (0.0,), (b"no picture",)))
    with refused("a picture is no JPEG"):
        read_film(path)


def jpeg(width: int) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (width, 4)).save(file, "JPEG")
    return file.getvalue()

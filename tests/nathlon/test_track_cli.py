"""`nathlon track` as a user meets it: from a file to a circuit and its map."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.image import imread
from typer.testing import CliRunner

from nathlon.cli import app
from nathlon.sim.errors import InputError
from nathlon.sim.track import read_track
from tests.support.centre_lines import path_of, stadium, write_line
from tests.support.circuit_dialects import DIALECTS


def nathlon(*arguments: str | Path) -> str:
    """What a command that goes well prints."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_a_centre_line_becomes_a_circuit_with_a_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_line(tmp_path / "line.csv", path_of(stadium()))
    said = nathlon("track", "import", "line.csv", "--name", "stadium")
    assert "stadium/circuit.toml: 1.7 km, 2 turns, level" in said
    assert read_track(tmp_path / "stadium" / "circuit.toml").name == "stadium"

    said = nathlon("track", "show", "stadium/circuit.toml")
    for words in ("Straight 1", "Turn 1", "Straight 2", "Turn 2", "Straight 3", "left", "stadium.png"):
        assert words in said
    height, width = imread("stadium.png").shape[:2]
    assert width > 2000
    assert height > 1500
    assert sorted(path.name for path in tmp_path.iterdir()) == ["line.csv", "stadium", "stadium.png"]


def test_the_circuit_goes_where_the_user_wants(tmp_path: Path) -> None:
    source = write_line(tmp_path / "line.csv", path_of(stadium()))
    nathlon("track", "import", source, "--name", "stadium", "--out", tmp_path / "new" / "circuits")
    assert (tmp_path / "new" / "circuits" / "stadium" / "circuit.toml").is_file()


def test_a_folder_becomes_circuits_and_a_sheet_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("files").mkdir()
    for name, dialect in (("oval.gpx", "gpx"), ("Oval.csv", "database")):
        Path("files", name).write_bytes(DIALECTS[dialect][0]())
    Path("files/notes.txt").write_text("to do", "utf-8")
    said = nathlon("track", "import", "files", "--out", "files", "--width", "12")
    assert "files/oval/circuit.toml: a table; the file's widths are left out for --width" in said
    assert "files/oval-2/circuit.toml: GPX; degrees made metres" in said
    assert "files/notes.txt: no points, expected columns" in said
    assert "Imported     2 of 3 files" in said
    height, width = imread("files/circuits.png").shape[:2]
    assert width == 2 * height, "two circuits side by side"
    with pytest.raises(InputError, match="files: none of 3 files made a circuit"):
        CliRunner().invoke(app, ["track", "import", "files", "--out", "files"], catch_exceptions=False)
    with pytest.raises(InputError, match="--name is 'oval', expected none for a folder"):
        CliRunner().invoke(app, ["track", "import", "files", "--name", "oval"], catch_exceptions=False)


def test_a_file_gives_its_name_and_what_was_guessed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("My Oval.geojson").write_bytes(DIALECTS["geojson"][0]())
    said = nathlon("track", "import", "My Oval.geojson")
    assert "my-oval/circuit.toml" in said
    assert "10 m is a guess" in said


def test_a_shipped_circuit_is_shown_by_name(tmp_path: Path) -> None:
    said = nathlon("track", "show", "lindenring", "--out", tmp_path / "map.png")
    assert "Haarnadel" in said
    picture = imread(tmp_path / "map.png")[..., :3]
    # Road, grass and paper each cover a share of the picture that the eye sees at once.
    assert 0.3 < (picture.min(axis=2) > 0.95).mean() < 0.98
    assert ((picture[..., 1] - picture[..., 2]) > 0.2).mean() > 0.005


def test_what_cannot_be_shown_is_one_sentence(tmp_path: Path) -> None:
    for arguments, words in (
        (["monza"], "circuit 'monza' is unknown"),
        (["lindenring", "--out", str(tmp_path)], "is a folder, expected a file to write"),
        (["lindenring", "--out", str(tmp_path / "no" / "map.png")], "map.png: cannot be written"),
    ):
        with pytest.raises(InputError, match=words):
            CliRunner().invoke(app, ["track", "show", *arguments], catch_exceptions=False)
    assert not list(tmp_path.iterdir())

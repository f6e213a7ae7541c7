"""Films of a selection's episodes: which ones, that they are those that were played, and what is said."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from PIL import Image

import nathlon
from nathlon.api.selection import SelectionResult
from nathlon.arena.film_recording import read_film
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.results.summary import Replay
from nathlon.selection.publish import films
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.publish.publish import publish
from nathlon.selection.run import RECORDINGS
from nathlon.sim.errors import InputError
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused
from tests.support.games import player, world_of

SETTINGS = """
[pareto]
races = 1
most_races = 1
keep_probability = 0.0
[battery]
runs = 2
[tournament]
pairs = 3
block = 3
"""


def select(folder: Path, made: str, **rights: int) -> SelectionResult:
    """A selection between policies that are right about some lights: about all, and about none."""
    rights = rights or {"all": 3, "none": 0}
    players = [player(folder / f"{name}.onnx", right) for name, right in rights.items()]
    (folder / "nathlon.toml").write_text(SETTINGS)
    world = world_of(folder, made)
    return nathlon.select(
        players, folder / "out", config=folder / "nathlon.toml", workers=1, world=world, progress=False
    )


@pytest.fixture(scope="module")
def duel(tmp_path_factory: pytest.TempPathFactory) -> SelectionResult:
    return select(tmp_path_factory.mktemp("duel"), "PettingZooWorld({'duel': envs['seen']}, step_s=0.5)")


def pictures(result: SelectionResult, replay: Replay) -> list[NDArray[np.uint8]]:
    film = read_film(result.report.parent / str(replay.recording))
    return [np.asarray(Image.open(io.BytesIO(picture))) for picture in film.pictures]


def test_the_deciding_episode_is_filmed_as_it_was_played(duel: SelectionResult) -> None:
    first = duel.summary.replays[0]
    assert first.why.startswith("the closest episode that the first of the ranking won against the second")
    assert duel.recording == (duel.report.parent / str(first.recording)).resolve()
    film = read_film(duel.recording)
    assert film.time_s == tuple(np.arange(7) / 2)
    last = pictures(duel, first)[-1].astype(int)
    with Store.open(str(duel.store)) as store:
        rows = store.results_of([first.match]).filter(pl.col("race") == first.race).sort("car")
    names = dict(duel._table("ranking").select("entrant", "name").iter_rows())
    assert first.seats == {"left": names[rows["entrant"][0]], "right": names[rows["entrant"][1]]}
    # A bar of 10 pixels for each of the hits; "all" has six and "none" has none.
    heights = [int((last[:, column : column + 20].min(axis=2) > 150).sum()) // 200 for column in (20, 80)]
    assert heights == [6 if who == "all" else 0 for who in first.seats.values()]


def test_what_is_there_already_is_not_played_again(duel: SelectionResult) -> None:
    root = duel.folder
    told: list[tuple[str, int, int]] = []
    lost = duel.report.parent / str(duel.summary.replays[0].recording)
    before, kept = lost.read_bytes(), {path: path.stat().st_mtime_ns for path in root.glob("races/*")}
    lost.unlink()
    with Store.open(str(duel.store)) as store, Pool(1) as pool:
        run = store.runs()[-1].name
        again = publish(store, run, OutputFolder(root), pool, lambda *one: told.append(one))
    assert again.summary.replays == duel.summary.replays
    assert lost.read_bytes() == before
    assert [path for path in root.glob("races/*") if path.stat().st_mtime_ns != kept[path]] == [
        lost.resolve()
    ]
    assert told == [(RECORDINGS, 0, 1), (RECORDINGS, 1, 1)]


def test_without_the_encoder_a_sentence_says_what_installs_it(
    duel: SelectionResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    def need(module: str, extra: str, what: str) -> Iterator[None]:
        raise InputError(f"{what} needs {module}, which the extra {extra} installs: pip install it")

    video = duel.report.parent / str(duel.summary.replays[0].video)
    content = video.read_bytes()
    video.unlink()
    monkeypatch.setattr(films, "need", need)
    with Store.open(str(duel.store)) as store, Pool(1) as pool:
        run = store.runs()[-1].name
        again = publish(store, run, OutputFolder(duel.folder), pool, lambda *_: None).summary.replays[0]
    video.write_bytes(content)
    assert again.video is None
    assert again.recording == duel.summary.replays[0].recording
    assert again.notes == (
        "There is no video: a video of an episode needs av, which the extra video installs: pip install it.",
    )


def test_where_nobody_meets_the_tests_are_filmed(tmp_path: Path) -> None:
    made = """PettingZooWorld({'chase': lambda: envs['Game']('a', 'b', 'prey', render_mode='rgb_array')},
        sides=[['a', 'b']])"""
    replays = select(tmp_path, made).summary.replays
    assert [replay.why.partition(":")[0] for replay in replays] == [
        "the best episode of the first of the ranking",
        "the worst episode of the first of the ranking",
        "the second of the ranking on the same seed as the best of the first",
    ]
    assert [replay.seats["a"] for replay in replays] == ["all", "all", "none"]
    assert all(replay.video for replay in replays)


def test_another_interpreter_sends_the_same_pictures(tmp_path: Path, duel: SelectionResult) -> None:
    made = "PettingZooWorld({'duel': 'envs.py:seen'}, python=sys.executable, step_s=0.5)"
    there = select(tmp_path, made)
    for near, far in zip(duel.summary.replays, there.summary.replays, strict=True):
        assert near.why == far.why
        for one, other in zip(pictures(duel, near), pictures(there, far), strict=True):
            assert (one == other).all()


def test_a_world_without_pictures_has_no_films(tmp_path: Path) -> None:
    result = select(tmp_path, "PettingZooWorld({'duel': envs['duel']})")
    assert result.summary.replays == ()
    assert result.recording is None
    assert not list((result.folder / "races").iterdir())
    page = result.report.read_text()
    assert "could not be run again" not in page.partition('id="data"')[2].partition("</script>")[0]
    done = command("replay", result.store, f"{key_of(result)}:0", "--no-open", cwd=tmp_path)
    refused(done, "has no pictures, expected environments made with render_mode 'rgb_array'")


def key_of(result: SelectionResult) -> str:
    with Store.open(str(result.store)) as store:
        return str(store.results()["match"][0])


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("drifts", "it ended otherwise when it was played again, expected what is stored"),
        ("flat", "render gives (4, 4) float64, expected a picture (height, width, 3) of uint8"),
    ],
)
def test_a_sentence_says_why_an_episode_is_not_filmed(tmp_path: Path, fault: str, said: str) -> None:
    made = f"PettingZooWorld({{'duel': envs['faulty']('{fault}')}})"
    summary = select(tmp_path, made, two=2, one=1).summary
    missing = [replay for replay in summary.replays if replay.missing]
    assert missing, "by luck some could end as before"
    for replay in missing:
        assert replay.recording is replay.video is None
        assert said in str(replay.missing)
    again = "An episode of scenario 'duel' came out otherwise when it was played again"
    assert any(again in note for note in summary.notes) == (fault == "drifts")


def test_the_command_shows_an_episode(duel: SelectionResult, tmp_path: Path) -> None:
    recording = duel.recording
    assert recording is not None
    done = command("replay", recording, "--no-open", cwd=tmp_path)
    assert done.returncode == 0
    assert recording.with_suffix(".rrd").read_bytes().startswith(b"RRF")
    recording.with_suffix(".rrd").unlink()
    first = duel.summary.replays[0]
    done = command(
        "replay",
        duel.store,
        f"{first.match}:{first.race}",
        "--out",
        "again",
        "--video",
        "v.webm",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "again" / recording.name).read_bytes() == recording.read_bytes()
    assert (tmp_path / "v.webm").stat().st_size > 0
    refused(command("replay", recording, "--video", "v.mp4", cwd=tmp_path), "a name that ends in .webm")
    refused(command("replay", recording, "--html", "v.html", cwd=tmp_path), "expected no --html")

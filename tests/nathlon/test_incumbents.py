"""The best of the nights before take part wherever their files lie by now; those that are gone are named."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from nathlon.arena.entrant import Entrant, enter
from nathlon.arena.pool import Pool
from nathlon.selection.nightly.incumbents import incumbents, located
from nathlon.selection.nightly.watching import watch
from tests.support.checkpoints import BUNDLED


@pytest.fixture
def best(tmp_path: Path) -> list[Entrant]:
    """Three in a watched folder, the best first."""
    (tmp_path / "watched").mkdir()
    found = []
    for number, source in enumerate(BUNDLED[:3]):
        path = shutil.copy(source, tmp_path / "watched" / f"step-{number}.safetensors")
        found.append(enter(str(path), "lindenring", "gt3"))
    return found


def take(folder: Path, best: list[Entrant], count: int, pool: Pool) -> tuple[list[Entrant], tuple[str, ...]]:
    return incumbents(pool, best, count, watch([str(folder / "watched")]), folder / "nights")


def test_a_file_that_is_renamed_or_moved_is_found(tmp_path: Path, best: list[Entrant], pool: Pool) -> None:
    champion, second, _ = best
    (tmp_path / "watched" / "old").mkdir()
    moved = Path(champion.source).rename(tmp_path / "watched" / "old" / "champion.safetensors")
    there, said = take(tmp_path, best, 2, pool)
    assert there == [replace(champion, source=str(moved)), second]
    assert said == ()


def test_what_was_sent_is_found_in_its_night(tmp_path: Path, best: list[Entrant], pool: Pool) -> None:
    champion = best[0]
    kept = tmp_path / "nights" / "night-0007" / "sent" / "step-0.safetensors"
    kept.parent.mkdir(parents=True)
    Path(champion.source).rename(kept)
    assert take(tmp_path, best, 1, pool) == ([replace(champion, source=str(kept))], ())


def test_those_that_are_gone_are_named_and_others_take_their_places(
    tmp_path: Path, best: list[Entrant], pool: Pool
) -> None:
    Path(best[0].source).unlink()
    shutil.copy(BUNDLED[3], best[1].source)
    there, [said] = take(tmp_path, best, 2, pool)
    assert there == [best[2]]
    assert said == (
        f"Missing among the best of the nights before: step-0 ({best[0].source}), step-1 ({best[1].source}). "
        "No watched file has the same contents."
    )
    assert take(tmp_path, best[2:], 2, pool) == ([best[2]], ())


def test_equal_files_are_known(tmp_path: Path, best: list[Entrant]) -> None:
    other = shutil.copy(best[0].source, tmp_path / "watched" / "same.safetensors")
    assert located(best[0], watch([str(tmp_path / "watched")]), tmp_path) == replace(
        best[0], also=(str(other),)
    )

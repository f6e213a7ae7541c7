"""Matches that are wanted on one machine and run on others: what travels, who takes what, and what goes wrong."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest
import sqlalchemy as sa

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool, run_matches
from nathlon.arena.queue import post
from nathlon.arena.queue_engine import QueueEngine
from nathlon.arena.queue_worker import Shift, work
from nathlon.arena.store import Store
from nathlon.arena.worlds.registry import load_world
from tests.games import player, refused, world_of

pytest_plugins = ["tests.databases"]

DUELS = 'PettingZooWorld({"duel": envs["duel"]}, measures={"hits": Declared("hits")})'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("games")


@pytest.fixture(scope="module")
def world(folder: Path) -> str:
    return world_of(folder, DUELS)


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(1) as pool:
        yield pool


def duels(world: str, folder: Path, count: int = 3) -> list[Match]:
    """Matches of two seeds each between a good and a bad player, whose files are in the folder."""
    folder.mkdir(exist_ok=True)
    sources = tuple(player(folder / f"{right}.onnx", right) for right in (3, 1))
    entrants = tuple(load_world(world).enter(source).id for source in sources)
    seats = (Seat(0, 0), Seat(1, 1))
    return [
        Match(
            "pareto", f"duel-{number}", "duel", "", "", entrants, sources,
            (Race(2 * number, seats), Race(2 * number + 1, seats)), world,
        )
        for number in range(count)
    ]  # fmt: skip


def results_of(matches: list[Match]) -> pl.DataFrame:
    """RESULTS of matches as one process gives them that has no store."""
    found = {match.key: frame for match, frame in run_matches(matches, 1)}
    return pl.concat([found[match.key] for match in matches])


def work_through(store: Store, pool: Pool, world: str) -> Shift:
    return work(store, pool, [world], wait_s=0.0)


def test_a_worker_has_the_results_of_the_machine_that_wants_them(
    target: str, world: str, tmp_path: Path, pool: Pool
) -> None:
    matches = duels(world, tmp_path / "here")
    expected = results_of(matches)
    with Store(target) as store:
        post(store, matches)
        if store.shared:
            shutil.rmtree(tmp_path / "here")  # the worker's machine has no such folder
        assert work_through(store, pool, world) == Shift(3, 0)
        assert store.results_of(match.key for match in matches).equals(expected)
        assert store.waiting() == {}
        assert store.owners() == []
        assert store.verify() == []

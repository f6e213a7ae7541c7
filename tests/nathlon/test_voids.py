"""Void runs: who could not be judged is not sent, and the verdict says so wherever it stands."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from pathlib import Path
from typing import Any

import polars as pl
import pytest

import nathlon
from nathlon.api.selection import SelectionResult
from nathlon.arena.engine import Ended
from nathlon.arena.match import Match
from nathlon.arena.match_policies import match_policies
from nathlon.arena.results import INTERRUPTED
from nathlon.arena.store import Store
from nathlon.arena.voids import not_judged_by_meetings, not_judged_by_tests
from nathlon.arena.watch import Watch
from nathlon.arena.world_registry import load_world
from nathlon.reports.verdict import verdict
from nathlon.results.selection import Selection
from nathlon.selection.config import read_config
from nathlon.selection.field import EntryList
from nathlon.selection.nightly.night import HEALTH, judge
from nathlon.selection.pipeline import run_pipeline
from nathlon.selection.publish.gathering import gather
from nathlon.selection.run import Run
from tests.nathlon.test_world_selection import settings
from tests.support.command_line import nathlon as command
from tests.support.games import player, world_of
from tests.support.race_results import rows

Spoil = Callable[[str, Sequence[str]], pl.Expr]
"""Of which rows of RESULTS the episode is void, in a match of a stage with those who are called so."""
NOTHING, ALL = pl.lit(False), pl.lit(True)


class Here:
    """An engine that has episodes played in this process, and voids some.

    Attributes:
        played: matches, in their order.
    """

    workers = 1

    def __init__(self, store: Store, names: dict[str, str], spoil: Spoil, ending: str) -> None:
        self.played: list[Match] = []
        self._store, self._names, self._spoil, self._ending = store, names, spoil, ending

    def run(self, matches: Sequence[Match]) -> Generator[Ended, None, None]:
        for match in matches:
            self.played.append(match)
            world = load_world(match.world)
            [(_, results)] = world.run({0: (match, match_policies(match))}, Watch())
            names = [self._names.get(entrant, "") for entrant in match.entrants]
            void = self._spoil(match.stage, names).any().over("race")
            ending = pl.when(void).then(pl.lit(self._ending)).otherwise("ending")
            results = results.with_columns(ending=ending)
            self._store.add_match(match.key, match.stage, match.spec(), results)
            yield Ended(match.key, here=True)

    def record(self, wanted: object) -> Any:
        raise NotImplementedError


class OwnProcess:
    """A pool that opens policies in this process."""

    workers = 1

    def open(self, openings: Sequence[Any], on_opened: Any = None) -> list[Any]:
        return [opening.function(*opening.arguments) for opening in openings]

    def run(self, matches: Sequence[Match]) -> Iterator[tuple[Match, pl.DataFrame]]:
        for match in matches:
            [(_, results)] = load_world(match.world).run({0: (match, match_policies(match))}, Watch())
            yield match, results


NAMES = ("all", "two", "none")


def selected(folder: Path, spoil: Spoil, ending: str = "simulator_fault") -> tuple[Selection, Here]:
    """What a selection of three players comes to where some episodes are void."""
    name = world_of(folder, "PettingZooWorld({'duel': envs['duel']})")
    config = read_config(settings(folder)).model_copy(update={"world": name}).suited
    sources = [player(folder / f"{name}.onnx", right) for name, right in zip(NAMES, (3, 2, 0), strict=True)]
    entrants = tuple(load_world(name).enter(source) for source in sources)
    store = Store(folder / "store.sqlite")
    store.begin_run("run", {})
    engine = Here(store, {entrant.id: entrant.name for entrant in entrants}, spoil, ending)
    pool: Any = OwnProcess()
    run = Run(store, "run", (1,), pool, lambda *_: None, other_engine=engine)
    assert run_pipeline(run, EntryList(entrants), config) is not None
    return gather(store, "run"), engine


def finals(stage: str, _: Sequence[str]) -> pl.Expr:
    """Void finals."""
    return ALL if stage == "tournament" else NOTHING


def test_where_all_finals_are_void_nobody_is_sent(tmp_path: Path) -> None:
    selection, _ = selected(tmp_path, finals)
    summary = selection.summary
    assert summary.sent == ()
    assert {(one.name, one.stage, one.void == one.runs > 0) for one in summary.not_judged} == {
        (name, "tournament", True) for name in NAMES
    }
    tournament = next(stage for stage in summary.stages if stage.name == "tournament")
    assert tournament.void == tournament.races > 0
    told = verdict(selection)
    assert told.headline == "Send nobody: all, two and none could not be judged"
    assert f"{summary.void:,} of {summary.car_runs:,} car runs are void" in told.sentences[-1]
    assert "only finalist" not in " ".join(told.sentences)
    assert judge(summary, 3, max_fault_share=1.0)[0] == HEALTH


def test_whoever_voids_most_of_its_finals_is_not_sent_and_the_others_are_judged(tmp_path: Path) -> None:
    """The best is, though it would win what is left."""

    selection, _ = selected(
        tmp_path,
        lambda stage, names: pl.col("race") % 6 < 4 if stage == "tournament" and "all" in names else NOTHING,
    )
    assert [one.name for one in selection.summary.not_judged] == ["all"]
    assert [one.name for one in selection.summary.sent] == ["two"]
    told = verdict(selection)
    assert told.headline == "Send two, though all could not be judged"
    assert "could not be judged: all (" in told.sentences[-1]
    assert told.sentences[-1].endswith(" pairs in the round robin).")


def test_whoever_cannot_be_filtered_or_tested_goes_no_further(tmp_path: Path) -> None:
    lost = {("pareto", "all"), ("battery", "two")}
    selection, _ = selected(tmp_path, lambda stage, names: ALL if (stage, names[0]) in lost else NOTHING)
    stages = {one.name: one.stage for one in selection.summary.not_judged}
    assert stages == {"all": "pareto", "two": "battery"}
    assert [one.name for one in selection.summary.sent] == ["none"]
    assert verdict(selection).headline == "Send none, though all and two could not be judged"


def test_a_few_void_episodes_are_told_and_nobody_is_left_out(tmp_path: Path) -> None:
    selection, _ = selected(tmp_path, lambda *_: pl.col("race") == 0)
    assert [one.name for one in selection.summary.sent] == ["all"]
    assert selection.summary.not_judged == ()
    told = verdict(selection)
    assert told.headline == "Send all"
    assert told.sentences[-1].endswith("car runs are void and count for nobody.")


def test_whoever_has_most_void_episodes_is_named(tmp_path: Path) -> None:
    selection, _ = selected(
        tmp_path, lambda _, names: pl.col("race") % 3 == 0 if names[0] == "none" else NOTHING
    )
    most = selection.summary.most_void
    assert most is not None
    assert most.name == "none"
    assert (
        verdict(selection)
        .sentences[-1]
        .endswith(f" count for nobody, most often for none: {most.void} of its {most.races} episodes.")
    )


def test_the_only_finalist_rests_on_its_tests(tmp_path: Path) -> None:
    selection, _ = selected(tmp_path, lambda stage, names: ALL if names[0] in NAMES[1:] else NOTHING)
    said = verdict(selection).sentences[1]
    assert said.startswith("It was the only finalist: the choice rests on its ")
    assert "episodes of the filter and" in said
    assert said.endswith(" episodes of the n-athlon.")


def test_what_the_machine_interrupted_is_run_again_and_not_kept(tmp_path: Path) -> None:
    """Once at once, and again by whoever calls next."""
    calls = Counter[tuple[str, ...]]()

    def at_first(stage: str, names: Sequence[str]) -> pl.Expr:
        calls[stage, *names] += 1
        return ALL if calls[stage, *names] == 1 else NOTHING

    selection, engine = selected(tmp_path, at_first, INTERRUPTED)
    assert (selection.summary.void, selection.summary.not_judged) == (0, ())
    played = Counter(match.key for match in engine.played)
    assert max(played.values()) == 2

    lasting = tmp_path / "lasting"
    lasting.mkdir()
    selection, engine = selected(lasting, finals, INTERRUPTED)
    assert len(selection.summary.not_judged) == 3
    lost = Counter(match.key for match in engine.played if match.stage == "tournament")
    assert set(lost.values()) == {2}
    selection, engine = selected(lasting, lambda *_: NOTHING)
    assert (selection.summary.void, selection.summary.not_judged) == (0, ())
    assert {match.key for match in engine.played} <= lost.keys(), "the rest was there"


def test_the_command_exits_with_3_and_tells_of_void_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    selection, _ = selected(tmp_path, finals)

    def select_(*_: object, on_verdict: Callable[[object], None] | None, **__: object) -> SelectionResult:
        if on_verdict:
            on_verdict(selection.summary)
        return SelectionResult(tmp_path, selection)

    monkeypatch.setattr("nathlon.arena.workers.start_server", lambda: None)
    monkeypatch.setattr(nathlon, "select", select_)
    done = command("evaluate", tmp_path / "all.onnx", "--out", "out", cwd=tmp_path)
    assert done.returncode == HEALTH
    told = " ".join(done.stdout.split())
    assert "Sent nobody: no finalist that could be judged passed the gates" in told
    assert f"Void {selection.summary.void} of {selection.summary.car_runs} car runs are void" in told
    done = command("evaluate", tmp_path / "all.onnx", "--out", "out", "--json", cwd=tmp_path)
    assert done.returncode == HEALTH
    assert len(json.loads(done.stdout)["not_judged"]) == 3


def meeting(match: str, first: str, second: str, void: Sequence[bool]) -> pl.DataFrame:
    """Mirrored pairs of two, some void by their second race."""
    races = [(pair, race, car) for pair in range(len(void)) for race in range(2) for car in range(2)]
    columns = {
        "match": match,
        "race": [2 * pair + race for pair, race, _ in races],
        "car": [car for *_, car in races],
        "team": [car for *_, car in races],
        "entrant": [(first, second)[car] for *_, car in races],
        "ending": ["simulator_fault" if void[pair] and race else "finished" for pair, race, _ in races],
    }
    return rows(columns, len(races))


def test_void_runs_are_laid_to_who_has_most_of_them() -> None:
    """c voids all its pairs: a and b are judged by those that they had with each other."""
    met = [("a", "b", [False] * 2), ("a", "c", [True] * 4), ("b", "c", [True] * 4)]
    results = pl.concat(meeting(f"{one}{two}", one, two, void) for one, two, void in met)
    [lost] = not_judged_by_meetings(results)
    assert (lost.entrant, lost.void, lost.runs) == ("c", 8, 8)
    both = not_judged_by_meetings(meeting("ab", "a", "b", [True, True, False]))
    assert [(one.entrant, one.void, one.runs) for one in both] == [("a", 2, 3), ("b", 2, 3)]


def test_half_of_the_runs_of_every_test_are_enough() -> None:
    columns = {
        "test": ["x"] * 4 + ["y"] * 3,
        "match": ["x"] * 4 + ["y"] * 3,
        "race": [0, 1, 2, 3, 0, 1, 2],
        "team": 0,
        "ending": ["finished", "finished", "interrupted", "simulator_fault", *["finished"] * 3],
    }
    results = rows(columns, 7)
    assert not_judged_by_tests(results) == []
    void = pl.when(pl.col("race") < 2).then(pl.lit("interrupted")).otherwise("ending")
    [worse] = not_judged_by_tests(results.with_columns(ending=void))
    assert (worse.test, worse.void, worse.runs) == ("x", 4, 4)

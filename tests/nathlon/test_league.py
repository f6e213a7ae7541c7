"""Leagues: who goes on and is drawn, two generations from end to end, going on after a stop, wrong input."""

from __future__ import annotations

import json
import math
from itertools import combinations
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from safetensors import safe_open

from nathlon.arena.pool import Pool
from nathlon.lab.league.generation import Generation, Member, conclude
from nathlon.lab.league.league import League
from nathlon.lab.league.settings import StopRule, read_league
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import checkpoint_id, read_card
from nathlon.policies.training import polish, trial
from nathlon.policies.training.polish import Round
from tests.support.command_line import nathlon, refused

LADDER = BUNDLED / "lindenring"
FIRST = ("lindenring-wake-028k", "lindenring-mend-059k")

TRAINING = """
circuit = "lindenring"
car = "gt3"
updates = 1
updates_per_step = 1
warm_up = 1
replay = 1
checkpoint_every = 1
opponents = ["driver"]

[[rollouts]]
scenario = "chicane_in_traffic"
races = 1
learners = 2

[reward]
unsporting = 5.0
"""

SELECTION = """
recordings = "notable"

[pareto]
races = 1
most_races = 2

[battery]
tests = ["pass_left"]
runs = 1

[tournament]
event = "event.toml"
sequential = false
"""

EVENT = """
[[race]]
name = "chicane"
circuit = "lindenring"
car = "gt3"
format = "2v2"
scenario = "chicane_in_traffic"
"""

LEAGUE = """
entrants = [ENTRANTS]
training = "training.toml"
selection = "nathlon.toml"
rounds = 2
generations = 2
population = 2
pairs = 2
seed = 3
"""


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Little is driven in polishing."""
    for name, value in {"GROUP": 4, "HORIZON_S": 3.0, "UNTOLD_S": 1.0}.items():
        monkeypatch.setattr(trial, name, value)
    monkeypatch.setattr(polish, "STARTS", 2)


def write(folder: Path, **files: str) -> Path:
    """The file of a league, and those that it names; what is given stands in their place."""
    folder.mkdir(exist_ok=True)
    entrants = ", ".join(f'"{LADDER / name}.safetensors"' for name in FIRST)
    made = {"training": TRAINING, "nathlon": SELECTION, "event": EVENT, "league": LEAGUE}
    for name, text in (made | files).items():
        (folder / f"{name}.toml").write_text(text.replace("ENTRANTS", entrants), "utf-8")
    return folder / "league.toml"


def run(path: Path, folder: Path, pool: Pool, stop_in: tuple[int, int] | None = None) -> list[Generation]:
    """All generations of a league; it is stopped after a round of a generation, if one is given."""

    def on_round(number: int, done: Round) -> None:
        if (number, done.rounds) == stop_in:
            raise KeyboardInterrupt

    league = League(read_league(path), folder)
    while not league.over:
        league.step(pool, on_round, lambda *_: None, lambda *_: None)
    return league.generations


def member(name: str, rank: int, points: float, at_fault: float | None, strength: float) -> Member:
    nothing = dict.fromkeys(name for name in Member.model_fields if name.endswith(("_low", "_high")))
    known: dict[str, Any] = {
        "entrant": name,
        "name": name,
        "source": name,
        "rank": rank,
        "points_per_race": points,
        "contacts_per_km": at_fault,
        "at_fault_per_km": at_fault,
        "races": 8,
        "penalties": 0.5,
        "bradley_terry": strength,
    }
    return Member.model_validate(nothing | known)


FIELD = [
    member("fast", 1, 22.0, 0.06, 1.0),
    member("clean", 1, 21.0, 0.01, 0.5),
    member("third", 2, 20.0, 0.05, 0.0),
    member("timid", 3, 15.0, 0.0, -1.5),
]


def test_of_the_first_rank_the_one_least_at_fault_goes_on_and_others_by_their_odds_against_it() -> None:
    made = conclude(0, FIELD, 3, StopRule(), None, None)
    assert made.champion == "fast"
    assert made.parent == "clean"
    assert [m.name for m in made.population] == ["fast", "clean", "third"]
    weights = {m.name: m.weight for m in made.members}
    odds = {name: weight / (1 - weight) for name, weight in weights.items() if weight}
    assert odds == pytest.approx({"fast": math.exp(0.5), "clean": 1.0, "third": math.exp(-0.5)})
    assert weights["timid"] == 0.0


def test_the_champion_of_the_first_stays_to_compare_with() -> None:
    before = conclude(0, FIELD, 3, StopRule(), None, None)
    later = [
        member("second child", 1, 24.0, 0.03, 1.0),
        member("child", 2, 23.0, 0.02, 0.5),
        member("clean", 3, 22.0, 0.01, 0.1),
        member("fast", 4, 18.0, 0.06, -1.0),
    ]
    made = conclude(1, later, 2, StopRule(), before, "child")
    assert (made.origin, made.parent, made.champion) == ("clean", "second child", "fast")
    assert {m.name for m in made.population} == {"second child", "fast"}


@pytest.mark.parametrize(
    ("stop", "reached"),
    [
        (StopRule(at_fault_per_km=0.01, points=1.0), True),
        (StopRule(at_fault_per_km=0.01, points=0.9), False),
        (StopRule(at_fault_per_km=0.009, points=1.0), False),
        (None, False),
    ],
)
def test_a_league_ends_when_it_is_clean_enough_at_no_loss_of_points(
    stop: StopRule | None, reached: bool
) -> None:
    assert conclude(0, FIELD, 4, stop, None, None).reached == reached


def test_who_has_not_moved_is_not_clean() -> None:
    stuck = [member("stuck", 1, 20.0, None, 0.0), member("moves", 1, 19.0, 0.3, 0.0)]
    assert conclude(0, stuck, 2, StopRule(), None, None).parent == "moves"
    assert not conclude(0, stuck[:1], 2, StopRule(), None, None).reached


def test_two_generations_and_going_on_after_a_stop(tmp_path: Path) -> None:
    path = write(tmp_path / "files")
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    with Pool(1) as pool:
        generations = run(path, whole, pool)
        with pytest.raises(KeyboardInterrupt):
            run(path, stopped, pool, stop_in=(2, 1))
        again = run(path, stopped, pool)
    assert [made.number for made in generations] == [0, 1, 2]
    names = [{m.name for m in made.members} for made in generations]
    assert names[0] == set(FIRST)
    for before, made, met in zip(generations, generations[1:], names[1:], strict=False):
        newcomer = f"generation-{made.number:02d}"
        assert met == {m.name for m in before.population} | {newcomer}
        assert made.newcomer == checkpoint_id(whole / newcomer / f"{newcomer}.safetensors")
        assert made.origin == before.parent
        assert made.champion == generations[0].members[0].entrant
        assert _opponents(whole / newcomer) == {m.source: m.weight for m in before.population}
    card = read_card(whole / "generation-01" / "generation-01.safetensors")
    assert card.algorithm.endswith(", polished")
    ids = [[(m.entrant, m.points_per_race, m.weight) for m in made.members] for made in generations]
    assert ids == [[(m.entrant, m.points_per_race, m.weight) for m in made.members] for made in again]


def _opponents(folder: Path) -> dict[str, float]:
    """Who drove beside the one that was polished in a folder, and how often, as its state says."""
    with safe_open(folder / "state.safetensors", framework="numpy") as file:
        settings = json.loads(file.metadata()["configuration"])
    return {opponent["policy"]: opponent["weight"] for opponent in settings["opponents"]}


def test_one_command_to_the_last_word_which_is_the_tournaments_own(tmp_path: Path) -> None:
    short = LEAGUE.replace("generations = 2", "generations = 1").replace("rounds = 2", "rounds = 1")
    path, out = write(tmp_path / "files", league=short), tmp_path / "out"
    done = nathlon("league", path, "--out", out, "--workers", "1", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert [made["number"] for made in told["generations"]] == [0, 1]
    assert Path(told["best"]).exists()
    rows = pl.read_csv(out / "generations.csv")
    assert rows.group_by("generation").agg(pl.col("parent").sum())["parent"].to_list() == [1, 1]
    assert rows.filter(pl.col("newcomer"))["name"].to_list() == ["generation-01"]
    assert json.loads((out / "generations.json").read_text())[0]["name"] == rows["name"][0]
    summary = json.loads((out / "selection" / "summary.json").read_text())
    raced = {row["name"] for row in summary["ranking"]}
    assert raced <= {*FIRST, "generation-01"}
    assert (out / "selection" / "report" / "index.html").exists()
    again = nathlon("league", path, "--out", out, "--workers", "1", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert "Who went on" in again.stdout
    other = write(tmp_path / "files", league=short.replace("seed = 3", "seed = 4"))
    refused(nathlon("league", other, "--out", out, cwd=tmp_path), "league.json", "another league")


OWN = 'learners = 2\nopponents = ["driver"]'
ONE = LEAGUE.replace("[ENTRANTS]", f'["{LADDER / FIRST[0]}.safetensors"]')
ELSEWHERE = LEAGUE.replace("[ENTRANTS]", f'["{BUNDLED}/porto-sereno"]')


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"league": LEAGUE.replace("rounds = 2", "rounds = 0")}, ("league.toml", "rounds")),
        ({"league": LEAGUE + "colour = 3"}, ("league.toml", "colour")),
        ({"league": LEAGUE.replace("training.toml", "none.toml")}, ("none.toml",)),
        ({"league": LEAGUE.replace('"training.toml"', '"nothing"')}, ("nothing", "unknown")),
        ({"league": ONE}, ("league.toml", "entrants", "two or more")),
        ({"league": ELSEWHERE}, ("league.toml", "porto-sereno", "expected 'lindenring'")),
        ({"training": TRAINING.replace("learners = 2", OWN)}, ("league.toml", "population")),
        ({"training": TRAINING.replace("learners = 2", "learners = 4")}, ("league.toml", "population")),
        ({"nathlon": 'world = "games.py:WORLD"\n' + SELECTION}, ("league.toml", "world")),
        ({"event": EVENT.replace("2v2", "4v4")}, ("event.toml", "chicane")),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(
    files: dict[str, str], said: tuple[str, ...], tmp_path: Path
) -> None:
    path = write(tmp_path / "files", **files)
    refused(nathlon("league", path, "--out", tmp_path / "out", cwd=tmp_path), *said)


def test_the_bundled_league_can_be_held() -> None:
    plan = read_league(BUNDLED / "league.toml")
    assert plan.selection.circuit == "lindenring"
    assert len(list(combinations(plan.sources, 2))) >= 6

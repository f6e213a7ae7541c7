"""Entrants that have a policy for each role: who plays in which seat, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import nathlon
from nathlon.arena.entrant import enter
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.watch import Watch
from nathlon.arena.world import World
from nathlon.arena.world_registry import load_world
from nathlon.policies.sources.finding import find_sources
from nathlon.policies.sources.identity import policy_id
from nathlon.selection.battery.skill import standing_tests
from tests.support.games import player, refused, world_of

SIDES = "sides=[['hunter_1', 'hunter_2'], ['prey']]"
ROLES = "roles={'hunter': ['hunter_1', 'hunter_2'], 'prey': ['prey']}"
MEASURES = "measures={'hits': Declared('hits')}"
HUNT = f"PettingZooWorld({{'hunt': envs['hunt']}}, {SIDES}, {ROLES}, {MEASURES})"


def pair(folder: Path, name: str, hunter: int, prey: int) -> str:
    """The source of an entrant whose policies name so many of the three lights rightly."""
    for part in ("hunters", "preys"):
        (folder / part).mkdir(exist_ok=True)
    player(folder / "hunters" / f"{hunter}.onnx", hunter)
    player(folder / "preys" / f"{prey}.onnx", prey, inputs=4)
    roles = folder / f"{name}.roles.toml"
    roles.write_text(f'[roles]\nhunter = "hunters/{hunter}.onnx"\nprey = "preys/{prey}.onnx"\n')
    return str(roles)


@pytest.fixture
def hunt(tmp_path: Path) -> World:
    return load_world(world_of(tmp_path, HUNT))


def test_every_seat_is_played_by_the_policy_of_its_role(tmp_path: Path, hunt: World) -> None:
    sources = (pair(tmp_path, "one", 3, 0), pair(tmp_path, "other", 0, 3))
    entrants = [hunt.enter(source) for source in sources]
    seats = (Seat(0), Seat(0), Seat(1))
    races = (Race(1, seats), Race(1, (Seat(1), Seat(1), Seat(0)), True))
    ids = tuple(entrant.id for entrant in entrants)
    match = Match("test", "hunt", "hunt", "", "", ids, sources, races, hunt.name)
    [(_, rows)] = hunt.run({0: (match, [hunt.policy(source) for source in sources])}, Watch())
    assert rows["ending"].unique().to_list() == ["finished"]
    hits = [row["measures"] for row in rows.sort("race", "car").iter_rows(named=True)]
    assert hits == ['{"hits": 6.0}'] * 3 + ['{"hits": 0.0}'] * 3


def test_it_is_known_by_what_plays_and_not_by_its_place(tmp_path: Path, hunt: World) -> None:
    (tmp_path / "elsewhere").mkdir()
    one, same = pair(tmp_path, "one", 3, 0), pair(tmp_path / "elsewhere", "same", 3, 0)
    entrant = hunt.enter(one)
    assert (entrant.name, entrant.id) == ("one", policy_id(one))
    assert hunt.enter(same).id == entrant.id
    assert hunt.enter(pair(tmp_path, "other", 2, 0)).id != entrant.id


def test_a_folder_stands_for_its_entrants_and_not_for_their_parts(tmp_path: Path) -> None:
    expected = [pair(tmp_path, "one", 3, 0), pair(tmp_path, "two", 3, 2)]
    alone = player(tmp_path / "preys" / "alone.onnx", 1)
    (tmp_path / "wrong.roles.toml").write_text("no roles")
    assert find_sources([tmp_path]) == sorted([*expected, alone, str(tmp_path / "wrong.roles.toml")])


def test_roles_have_tests_of_their_own(hunt: World) -> None:
    tests = {test.name: test.slots for test in standing_tests(hunt)}
    assert tests == {"hunt as hunter": (1,), "hunt as prey": (2,)}


def test_who_is_best_in_both_roles_is_sent(tmp_path: Path, hunt: World) -> None:
    field = tmp_path / "field"
    field.mkdir()
    for name, hunter, prey in (("both", 3, 3), ("hunts", 3, 0), ("flees", 0, 3)):
        pair(field, name, hunter, prey)
    config = tmp_path / "nathlon.toml"
    config.write_text(
        "[pareto]\nraces = 2\nmost_races = 2\nkeep_probability = 0.0\n"
        "[battery]\nruns = 4\n[tournament]\npairs = 6\nblock = 3\n"
    )
    result = nathlon.select(
        field, tmp_path / "out", config=config, workers=1, world=hunt.name, progress=False
    )
    assert result.sent == ["both"]
    assert sorted(result.ranking["name"]) == ["both", "flees", "hunts"]
    assert result.summary.faults == result.summary.void == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('hunter = "random"', "role 'prey' is missing, expected hunter, prey"),
        (
            'hunter = "random"\nprey = "random"\ntree = "random"',
            "role 'tree' is unknown, expected hunter, prey",
        ),
        ('hunter = "random"\nprey = "three.onnx"', "role 'prey'"),
        ('hunter = "random"\nprey = "gone.onnx"', "gone.onnx"),
        ('hunter = "one.roles.toml"\nprey = "random"', "role 'hunter' is 'one.roles.toml', expected a file"),
        ("hunter = 3", "roles"),
    ],
)
def test_what_is_no_entrant_is_refused(tmp_path: Path, hunt: World, text: str, said: str) -> None:
    player(tmp_path / "three.onnx", 3)
    roles = tmp_path / "x.roles.toml"
    roles.write_text(f"[roles]\n{text}\n")
    with refused(str(roles), said):
        hunt.enter(str(roles))


def test_roles_are_refused_where_there_are_none(tmp_path: Path) -> None:
    one = pair(tmp_path, "one", 3, 3)
    without = load_world(world_of(tmp_path, "PettingZooWorld({'duel': envs['duel']})", "duel.py"))
    with refused(one, "role 'hunter' is unknown, expected none"):
        without.enter(one)
    with refused(one, "names policies by role"):
        enter(one, "lindenring", "gt3")


def test_one_policy_is_told_to_be_of_one_role(tmp_path: Path, hunt: World) -> None:
    assert hunt.enter("random").id == "random"
    with refused("takes 3 numbers, expected 4", "NAME.roles.toml with a policy for each role"):
        hunt.enter(player(tmp_path / "three.onnx", 3))


def test_a_world_gives_every_seat_of_a_side_a_role(tmp_path: Path) -> None:
    roles = "roles={'hunter': ['hunter_1'], 'prey': ['prey']}"
    made = f"PettingZooWorld({{'hunt': envs['hunt']}}, {SIDES}, {roles})"
    with refused("seat 'hunter_2' has no role, expected one for every seat of a side"):
        load_world(world_of(tmp_path, made)).setup("hunt")

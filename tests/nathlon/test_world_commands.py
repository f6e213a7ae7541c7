"""`nathlon world`: what it says of worlds that can be selected in, and of those that cannot."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from nathlon.arena.pool import Pool
from nathlon.arena.worlds.rehearsal import fairness, rehearse
from tests.support.command_line import nathlon, refused
from tests.support.games import world_of


def test_the_worlds_that_are_known_are_listed(tmp_path: Path) -> None:
    done = nathlon("world", "list", "--json", cwd=tmp_path)
    assert done.returncode == 0
    assert {"name": "racing", "from": "nathlon"} in json.loads(done.stdout)
    assert "racing" in nathlon("world", "list", cwd=tmp_path).stdout


def test_a_good_world_is_found_good(tmp_path: Path) -> None:
    name = world_of(tmp_path, "PettingZooWorld({'duel': envs['duel'], 'team': envs['team']}, points='place')")
    done = nathlon("world", "check", name, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["usable"]
    duel = report["scenarios"][0]
    assert (duel["name"], duel["seats"], duel["sides"]) == ("duel", ["left", "right"], [["left"], ["right"]])
    assert duel["episode_s"] > 0
    said = [finding["says"] for finding in report["findings"] if finding["scenario"] == "duel"]
    assert "An episode with the same seed and seats repeats to the bit." in said
    assert "A policy that raises is out, and the others play on." in said
    assert "PettingZoo's parallel_seed_test passes." in said
    assert any("no side gets more than another" in sentence for sentence in said)
    assert any("points are by place" in sentence for sentence in report["tells"])


def test_an_unfair_side_is_a_note_and_no_fault(tmp_path: Path) -> None:
    done = nathlon(
        "world", "check", world_of(tmp_path, "PettingZooWorld({'d': envs['uneven']})"), cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert "d: Side 1 gets" in done.stdout
    assert "points an episode more than side 2" in done.stdout


def test_what_a_world_without_sides_cannot_tell_is_said(tmp_path: Path) -> None:
    measures = "measures={'steps': Declared('steps', 'steps', 'min')}"
    name = world_of(tmp_path, f"GymnasiumWorld({{'only': envs['Alone']}}, {measures})")
    done = nathlon("world", "check", name, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "there is no round robin: the n-athlon ranks" in done.stdout
    assert "steps (steps, less is better)" in done.stdout


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("drifts", "seat 'left': "),
        ("nan", "step 2: seat 'left': observation with NaN"),
        ("forgets", "step 5: seat 'left': no reward, expected that of its last step"),
        ("old", "step 0: seat 'left': gives 4 values"),
        ("exits", "ended the process"),
    ],
)
def test_a_world_that_cannot_be_used_is_refused_with_a_sentence(
    tmp_path: Path, fault: str, said: str
) -> None:
    name = world_of(tmp_path, f"PettingZooWorld({{'duel': envs['faulty']('{fault}')}})")
    refused(nathlon("world", "check", name, cwd=tmp_path), f"world {name!r}, scenario 'duel'", said)


@pytest.mark.parametrize("name", ["racing", "chess", "no_such_package:world"])
def test_what_is_no_world_to_be_checked_is_refused(tmp_path: Path, name: str) -> None:
    refused(nathlon("world", "check", name, cwd=tmp_path), f"world '{name}'")


@pytest.mark.parametrize("fault", ["hangs", "prints"])
def test_a_world_that_hangs_is_ended(tmp_path: Path, fault: str) -> None:
    name = world_of(tmp_path, f"PettingZooWorld({{'duel': envs['faulty']('{fault}')}})")
    with Pool(1, first_answer_s=4.0) as pool:
        report = rehearse(pool, name)
    [finding] = report.faults
    assert finding.says.startswith(f"world {name!r}, scenario 'duel': took more than 4 s")


def test_fairness_is_told_from_differences_between_sides() -> None:
    rng = np.random.default_rng(1)
    luck = rng.normal(size=(20, 1))
    even = np.hstack([luck, -luck])
    assert "beyond chance" in fairness(even)[0]
    [said] = fairness(even + np.array([3.0, 0.0]))
    assert said.startswith("Side 1 gets")
    assert "fairness does not show" in fairness(np.ones((5, 3)))[0]
    [said] = fairness(np.tile([0.0, 1.0], (4, 1)))
    assert said.startswith("Side 2 gets 1 points an episode more than side 1")

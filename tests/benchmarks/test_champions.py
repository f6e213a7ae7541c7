"""The champions' figures: known answers, who they are, and one measurement in full."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks import champions
from benchmarks.champions import entrants_of, from_the_back, places, race_match, rate_interval
from benchmarks.result import read_result
from benchmarks.time_trial import time_trial
from nathlon.policies.checkpoint import Card, save_checkpoint
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.support.race_results import rows


def save(path: Path, step: int, circuit: str = "lindenring", seed: int = 0) -> Path:
    """A checkpoint of an untrained policy."""
    card = Card(
        algorithm="QR-SAC",
        hidden=(4,),
        observation=ObservationSpec(course_points=2),
        circuit=circuit,
        car="gt3",
        scenarios=("1v0",),
        step=step,
        transitions=0,
        seed=seed,
        created_by={},
    )
    rng = np.random.default_rng([seed, step])
    tensors = {name: rng.normal(0.0, 0.05, shape).astype(np.float32) for name, shape in card.shapes.items()}
    save_checkpoint(path, tensors, card)
    return path


def test_laps_that_were_not_completed_are_the_slowest() -> None:
    trial = time_trial(
        rows(
            {
                "best_lap_s": [100.0, None, 104.0, 102.0],
                "off_course_s": [0.0, 40.0, 0.0, 2.0],
                "driven_s": [100.0, 360.0, 104.0, 136.0],
            },
            4,
        )
    )
    assert trial.lap_s == 103.0
    assert trial.best_s == 100.0
    assert trial.clean == 2
    assert trial.off_course_share == pytest.approx(0.06)
    half = time_trial(rows({"best_lap_s": [100.0, None, None, 101.0]}, 4))
    assert half.lap_s == math.inf


def test_wins_count_only_at_the_flag() -> None:
    ends = ["finished"] * 8 + ["time_up", "finished", "simulator_fault"]
    figures = from_the_back(
        rows({"race": range(11), "ending": ends, "place": [1, 2, 1, 1, 8, 3, 1, 2, 1, 1, 1]}, 11),
        np.random.default_rng(0),
    )
    assert (figures["races"], figures["finished"], figures["wins_from_back"]) == (10, 9, 5)
    assert figures["mean_place"] == 2.1
    assert places(rows({"ending": ends, "place": [1, 2, 1, 1, 8, 3, 1, 2, 1, 1, 1]}, 11)) == {
        "wins": 5,
        "mean_place": 2.1,
        "at_fault_per_km": 0.0,
    }
    # Wilson's interval of 5 in 10, as tabulated: 0.237 to 0.763.
    assert figures["wins_low"] == pytest.approx(2.37, abs=0.01)
    assert figures["wins_high"] == pytest.approx(7.63, abs=0.01)


def test_contacts_are_counted_by_kilometre() -> None:
    figures = from_the_back(
        rows(
            {"contacts": [3, 1, 0, 4], "contacts_at_fault": [1, 0, 0, 1], "distance_m": [5e3, 5e3, 2e3, 4e3]},
            4,
        ),
        np.random.default_rng(0),
    )
    assert figures["contacts_per_km"] == 0.5
    assert figures["at_fault_per_km"] == 0.125
    assert places(rows({"contacts_at_fault": [1, 2], "distance_m": [5e3, 7e3]}, 2))["at_fault_per_km"] == 0.25
    for name in ("contacts", "at_fault"):
        assert figures[f"{name}_low"] < figures[f"{name}_per_km"] < figures[f"{name}_high"]


def test_no_contact_in_a_few_kilometres_is_no_proof_of_none() -> None:
    rate, low, high = rate_interval(np.zeros(4), np.full(4, 5.0), np.random.default_rng(0))
    # With none seen, the upper bound of a Poisson mean is -ln(tail).
    assert (rate, low) == (0.0, 0.0)
    assert high == pytest.approx(-math.log(0.025) / 20.0)


def test_races_apart_widen_the_interval_of_a_rate() -> None:
    rng = np.random.default_rng(0)
    km = np.full(10, 8.0)
    even = rate_interval(np.full(10, 4.0), km, rng)
    uneven = rate_interval(np.array([0.0] * 8 + [20.0] * 2), km, rng)
    assert even[0] == uneven[0] == 0.5
    # As wide as counting 40 events allows: exact bounds 28.577 and 54.469.
    assert even[1:] == pytest.approx((28.577 / 80, 54.469 / 80), abs=1e-4)
    assert uneven[1] < even[1] < even[2] < uneven[2]


def test_who_did_not_move_has_no_rate() -> None:
    figures = from_the_back(rows({"distance_m": 0.0, "ending": "policy_raised"}, 2), np.random.default_rng(0))
    assert figures["contacts_per_km"] is None
    assert figures["wins_from_back"] == 0
    assert places(rows({"distance_m": 0.0, "ending": "stuck"}, 2))["at_fault_per_km"] is None


def test_the_champion_starts_last_among_seven_drivers(tmp_path: Path) -> None:
    [entrant] = entrants_of([save(tmp_path / "a-1.safetensors", 1)], [])["lindenring", "gt3"]
    match = race_match(entrant, 3)
    assert match.entrants == (entrant.id, "driver")
    assert [[seat.entrant for seat in race.seats] for race in match.races] == [[1] * 7 + [0]] * 3
    assert len({race.seed for race in match.races}) == 3
    assert race_match(entrant, 3, "driver:pace=0.9").entrants == (entrant.id, "driver:pace=0.9")


def test_checkpoints_go_where_their_cards_say(tmp_path: Path) -> None:
    paths = [
        save(tmp_path / "a-1.safetensors", 1),
        save(tmp_path / "b-1.safetensors", 2, "porto-sereno"),
        save(tmp_path / "a-2.safetensors", 3),
    ]
    found = entrants_of(paths, [])
    assert {where: [e.name for e in those] for where, those in found.items()} == {
        ("lindenring", "gt3"): ["a-1", "a-2"],
        ("porto-sereno", "gt3"): ["b-1"],
    }
    assert list(entrants_of(paths, ["porto-sereno"])) == [("porto-sereno", "gt3")]
    with pytest.raises(InputError, match="circuit grandes-landes: no checkpoint"):
        entrants_of(paths, ["grandes-landes"])


def test_bundled_champions_are_named_or_the_last_of_each_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(champions, "BUNDLED", tmp_path)
    monkeypatch.setattr(champions, "CHAMPIONS", tmp_path / "champions.toml")
    for run in ("fast", "calm"):
        for step in (9, 80, 700):
            save(tmp_path / f"{run}-{step}.safetensors", step)
    assert {path.stem for path in champions.bundled_champions()} == {"fast-700", "calm-700"}
    (tmp_path / "champions.toml").write_text('names = ["calm-80"]')
    assert champions.bundled_champions() == [tmp_path / "calm-80.safetensors"]


def test_a_measurement_in_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = save(tmp_path / "novice-1.safetensors", 1), tmp_path / "champions.json"
    monkeypatch.setattr(champions, "LONG_PACES", (0.95,))
    monkeypatch.setattr("sys.argv", ["champions", "--json", str(out), "--races", "1", str(path)])
    champions.main()
    figures = read_result(out).figures["lindenring"]["gt3"]
    assert figures["driver"]["clean_starts"] == 8
    assert 1.0 < figures["driver"]["limit_ratio"] < 1.1
    assert figures["driver"]["driver_ratio"] == 1.0
    driver = figures["driver"]
    assert (driver["races"], driver["finished"]) == (1, 1)
    assert driver["mean_place"] > 1.0  # it laps as fast as those in front
    assert driver["seven_laps"]["0.95"]["mean_place"] < 8.0  # and faster than these
    novice = figures["champions"]["novice-1"]
    assert novice["lap_s"] is None
    assert (novice["wins_from_back"], novice["mean_place"], novice["races"]) == (0, 8.0, 1)
    assert list(novice["seven_laps"]) == ["0.95"]
    # It does not get away, so it has no rate.
    assert novice["seven_laps"]["0.95"] == {"wins": 0, "mean_place": 8.0, "at_fault_per_km": None}
    assert "novice-1" in capsys.readouterr().out

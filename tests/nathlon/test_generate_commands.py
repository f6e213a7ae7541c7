"""`nathlon track generate` and `nathlon car ...`: what they write and say, and their exit codes."""

from __future__ import annotations

import json
from pathlib import Path

from nathlon.sim.car import load_car, read_car
from nathlon.sim.track import read_track
from nathlon.sim.track.generating import generate_track
from tests.support.command_line import nathlon


def test_a_circuit_is_generated_once(tmp_path: Path) -> None:
    arguments = (
        "track",
        "generate",
        "--seed",
        "4",
        "--style",
        "national",
        "--length",
        "2000",
        "--out",
        "made",
    )
    done = nathlon(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "made/national-4/circuit.toml: 2.0 km" in done.stdout
    track = read_track(tmp_path / "made" / "national-4" / "circuit.toml")
    assert track.length == generate_track(4, "national", 2000.0).length
    again = nathlon(*arguments, cwd=tmp_path)
    assert again.returncode == 2
    assert again.stderr == "nathlon: made/national-4: is there already, expected the name of a new folder\n"


def test_a_style_that_is_none_leaves_nothing(tmp_path: Path) -> None:
    done = nathlon("track", "generate", "--seed", "4", "--style", "rally", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "nathlon: --style: 'rally', expected one of grand-prix, street, national\n"
    assert list(tmp_path.iterdir()) == []


def test_a_car_is_generated_checked_and_tuned(tmp_path: Path) -> None:
    made = nathlon("car", "generate", "--seed", "2", "--json", cwd=tmp_path)
    assert json.loads(made.stdout)["car"] == "car-2.toml"
    told = json.loads(nathlon("car", "check", "car-2.toml", "--json", cwd=tmp_path).stdout)
    assert (told["name"], told["odd"]) == ("car-2", [])
    assert told["cornering_m_s2"] == sorted(told["cornering_m_s2"]), "downforce grows with speed"
    tuning = ("--mass", "1.1", "--compound", "comfort-soft")
    tuned = nathlon("car", "tune", "car-2.toml", "--name", "heavy", *tuning, cwd=tmp_path)
    assert "comfort-soft tyres" in tuned.stdout
    heavy, before = read_car(tmp_path / "heavy.toml"), read_car(tmp_path / "car-2.toml")
    assert (heavy.name, heavy.tyre.compound) == ("heavy", "comfort-soft")
    assert heavy.body.mass_kg == 1.1 * before.body.mass_kg


def test_a_shipped_car_does_what_is_known_of_it(tmp_path: Path) -> None:
    told = json.loads(nathlon("car", "check", "gt3", "--json", cwd=tmp_path).stdout)
    car = load_car("gt3")
    # A GT3 corners at 1.5 g without much downforce and reaches some 280 km/h.
    assert 13.0 < told["cornering_m_s2"][0] < 16.0
    assert 270.0 < 3.6 * told["top_m_s"] < 300.0
    assert told["power_w"] == max(
        rpm * torque * 3.141592653589793 / 30
        for rpm, torque in zip(car.engine.rpm, car.engine.torque_n_m, strict=True)
    )


def test_what_is_odd_ends_with_1_and_what_is_wrong_with_2(tmp_path: Path) -> None:
    nathlon("car", "generate", "--seed", "2", cwd=tmp_path)
    text = (tmp_path / "car-2.toml").read_text("utf-8")
    inertia = next(line for line in text.splitlines() if line.startswith("yaw_inertia"))
    (tmp_path / "odd.toml").write_text(text.replace(inertia, "yaw_inertia_kg_m2 = 9000.0"), "utf-8")
    odd = nathlon("car", "check", "odd.toml", cwd=tmp_path)
    assert odd.returncode == 1
    assert "odd.toml: body.yaw_inertia_kg_m2 is 9000, expected" in odd.stderr
    (tmp_path / "wrong.toml").write_text(text.replace(inertia, "yaw_inertia_kg_m2 = -1.0"), "utf-8")
    wrong = nathlon("car", "check", "wrong.toml", cwd=tmp_path)
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("nathlon: wrong.toml: field body.yaw_inertia_kg_m2 is -1.0")
    assert nathlon("car", "tune", "gt3", "--name", "Two Words", cwd=tmp_path).returncode == 2

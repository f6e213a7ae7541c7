"""Car files: the shipped one, and what is said about faulty ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sim.car import CARS, load_car, parameters, read_car
from sim.errors import InputError

GT3 = (CARS / "gt3.toml").read_text("utf-8")


def edited(folder: Path, old: str, new: str) -> Path:
    """The shipped file with one place changed."""
    assert GT3.count(old) == 1
    path = folder / "car.toml"
    path.write_text(GT3.replace(old, new), "utf-8")
    return path


def test_shipped_car_reads_by_name_and_by_path() -> None:
    car = load_car("gt3")
    assert car == load_car(str(CARS / "gt3.toml"))
    assert (car.name, car.body.mass_kg, len(car.gearbox.ratios)) == ("gt3", 1370.0, 6)


def test_parameters_are_those_of_the_file() -> None:
    car = load_car("gt3")
    p = parameters(car)
    assert 2 * (p.brake_torque_front + p.brake_torque_rear) == pytest.approx(car.brakes.torque_n_m)
    assert p.brake_torque_front / p.brake_torque_rear == pytest.approx(0.74 / 0.26)
    np.testing.assert_allclose(p.ratios, np.array(car.gearbox.ratios) * car.gearbox.final_drive)
    assert p.friction_y + p.friction_y_slope * (6500.0 - p.load_low) == pytest.approx(1.41)
    # The magic formula peaks where shape * atan(stiffness * slip) is a right angle: at slip 1.
    assert p.shape * np.arctan(p.stiffness) == pytest.approx(np.pi / 2)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("mass_kg = 1370.0", "mass_kg = -1.0", "field body.mass_kg is -1.0: .*greater than 0"),
        ("mass_kg = 1370.0", "mass_kg = inf", "field body.mass_kg is inf: .*finite"),
        ("mass_kg = 1370.0", 'mass_kg = "heavy"', "field body.mass_kg is 'heavy': .*number"),
        ("mass_kg = 1370.0", "", "field body.mass_kg: Field required"),
        ("mass_kg = 1370.0", "mass_kg = 1370.0\nmass_lb = 3020.0", "field body.mass_lb: Extra"),
        ("front_share = 0.74", "front_share = 1.2", "field brakes.front_share is 1.2: .*less than or equal"),
        ("full_lock_rad = 0.36", "full_lock_rad = 20.0", "field steering.full_lock_rad is 20.0: .*less than"),
        ("rpm =        [1000.0, 2500.0", "rpm =        [2500.0, 1000.0", "field engine .*rpm must rise"),
        ("rpm =        [1000.0, ", "rpm =        [", "field engine .*the same length"),
        ("load_n = [2000.0, 6500.0]", "load_n = [6500.0, 2000.0]", "field tyre .*load_n must rise"),
        ("ratios = [2.95, 2.12, 1.65, 1.35, 1.14, 0.98]", "ratios = []", "field gearbox.ratios .*at least 1"),
        ("shape = 1.75", "shape = 1.0", "field tyre.shape is 1.0: .*greater than 1"),
        ("[wheel]", "[wheels]", "field wheel: Field required"),
    ],
)
def test_faulty_field_is_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    path = edited(tmp_path, old, new)
    with pytest.raises(InputError, match=complaint) as caught:
        read_car(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_file_that_is_missing_or_no_toml(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.toml: cannot read the car file"):
        load_car(str(tmp_path / "nowhere.toml"))
    text = tmp_path / "text.toml"
    text.write_text("a fast car")
    with pytest.raises(InputError, match=r"text\.toml: not a TOML file"):
        read_car(text)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"binary\.toml: not a TOML file"):
        read_car(binary)


def test_unknown_car_lists_the_known() -> None:
    with pytest.raises(InputError, match="car 'f1' is unknown; expected one of gt3"):
        load_car("f1")

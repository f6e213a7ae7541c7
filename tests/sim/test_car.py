"""Car files: the shipped ones, and what is said about faulty ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nathlon.sim.car import compound_ratio, load_car, load_compounds, parameters, read_car
from nathlon.sim.car_check import oddities
from nathlon.sim.data_file import DATA
from nathlon.sim.errors import InputError
from nathlon.sim.tyre_curve import curve_cells
from tests.support.refusals import refusal

CARS = DATA / "cars"
NAMES = sorted(path.stem for path in CARS.glob("*.toml"))
GT3 = (CARS / "gt3.toml").read_text("utf-8")


def edited(folder: Path, old: str, new: str) -> Path:
    """The shipped file with one place changed."""
    assert GT3.count(old) == 1
    path = folder / "car.toml"
    path.write_text(GT3.replace(old, new), "utf-8")
    return path


@pytest.mark.parametrize("name", NAMES)
def test_shipped_cars_make_sense(name: str) -> None:
    car = load_car(name)
    assert car.name == name
    assert car.description
    assert oddities(car) == []


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
    assert p.dry_mass + p.fuel_capacity == car.body.mass_kg


def test_table_of_the_tyre_curve_is_the_magic_formula() -> None:
    shape = load_car("gt3").tyre.shape
    slip = np.geomspace(1e-6, 100.0, 2001)
    cells = curve_cells(shape)
    at = slip / (1 + slip) * len(cells)
    cell = np.minimum(at.astype(int), len(cells) - 1)
    share = sum(cells[cell, power] * (at - cell) ** power for power in range(4))
    wanted = np.sin(shape * np.arctan(np.tan(np.pi / (2 * shape)) * slip))
    np.testing.assert_allclose(share * slip, wanted, atol=1e-7)


def test_compounds_trade_grip_for_wear() -> None:
    compounds = {name: one for name, one in load_compounds().items() if not one.treaded}
    names = [
        f"{use}-{kind}" for use in ("comfort", "sports", "racing") for kind in ("hard", "medium", "soft")
    ]
    assert list(compounds) == names
    for quantity in ("grip", "wear"):
        values = [getattr(compounds[name], quantity) for name in names]
        assert values == sorted(set(values))
    reference = compounds["racing-medium"]
    assert (reference.grip, reference.wear) == (1.0, 1.0)


def test_compound_scales_a_car_from_its_own() -> None:
    car = load_car("coupe")
    grip, wear = compound_ratio(car.tyre.compound, "racing-soft")
    own, fitted = parameters(car), parameters(car, "racing-soft")
    assert (fitted.friction_y, fitted.friction_x_slope) == pytest.approx(
        (grip * own.friction_y, grip * own.friction_x_slope)
    )
    assert fitted.wear_per_joule == pytest.approx(wear * own.wear_per_joule)
    assert parameters(car, car.tyre.compound).friction_x == own.friction_x
    assert grip > 1.1
    assert wear > 2.0


def test_unknown_compound_lists_the_known() -> None:
    with pytest.raises(
        InputError, match=r"compound 'rain' is unknown; expected one of comfort-hard, .*racing-soft"
    ):
        parameters(load_car("gt3"), "rain")


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("mass_kg = 1370.0", "mass_kg = -1.0", "field body.mass_kg is -1.0: .*greater than or equal to 10"),
        ("mass_kg = 1370.0", "mass_kg = inf", "field body.mass_kg is inf: .*finite"),
        ("mass_kg = 1370.0", 'mass_kg = "heavy"', "field body.mass_kg is 'heavy': .*number"),
        ("mass_kg = 1370.0", "", "field body.mass_kg: Field required"),
        (
            "mass_kg = 1370.0",
            "mass_kg = 1370.0\nmass_lb = 3020.0",
            "field body.mass_lb is unknown; .*mass_kg",
        ),
        ("front_share = 0.74", "front_share = 1.2", "field brakes.front_share is 1.2: .*less than or equal"),
        ("full_lock_rad = 0.36", "full_lock_rad = 20.0", "field steering.full_lock_rad is 20.0: .*less than"),
        ("rpm =        [1000.0, 2500.0", "rpm =        [2500.0, 1000.0", "field engine: rpm must rise"),
        ("rpm =        [1000.0, ", "rpm =        [", "field engine: .*the same length"),
        ("load_n = [2000.0, 6500.0]", "load_n = [6500.0, 2000.0]", "field tyre: load_n must rise"),
        ("ratios = [2.95, 2.12, 1.65, 1.35, 1.14, 0.98]", "ratios = []", "field gearbox.ratios .*at least 1"),
        ("shape = 1.75", "shape = 1.0", "field tyre.shape is 1.0: .*greater than or equal to 1.05"),
        ("[wheel]", "[wheels]", "field wheel: Field required"),
    ],
)
def test_faulty_field_is_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    path = edited(tmp_path, old, new)
    with refusal(path, complaint):
        read_car(path)


def test_file_that_is_missing_or_no_toml(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.toml: cannot read the car file"):
        load_car(str(tmp_path / "nowhere.toml"))
    text = tmp_path / "text.toml"
    text.write_text("a fast car")
    with pytest.raises(InputError, match=r"text\.toml: not a TOML file"):
        read_car(text)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"binary\.toml: cannot read the car file"):
        read_car(binary)


def test_unknown_car_lists_the_known() -> None:
    with pytest.raises(InputError, match="car 'f1' is unknown; expected one of coupe, gt3, prototype"):
        load_car("f1")

"""Cars: data files with units in their field names, checked and turned into kernel parameters."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from sim.data_file import DATA, Section, find_data, read_toml
from sim.errors import InputError
from sim.tyre_curve import curve_cells

TORQUE_POINTS = 64

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]


class Body(Section):
    mass_kg: Positive
    yaw_inertia_kg_m2: Positive
    length_m: Positive
    width_m: Positive
    front_axle_m: Positive
    rear_axle_m: Positive
    front_track_m: Positive
    rear_track_m: Positive
    centre_of_mass_height_m: Positive
    roll_stiffness_front_share: Share
    load_transfer_lag_s: Positive


class Aero(Section):
    drag_area_m2: NotNegative
    downforce_area_m2: NotNegative
    downforce_front_share: Share
    draught_drag_share: Share
    draught_downforce_share: Share


class Steering(Section):
    full_lock_rad: Annotated[float, Field(gt=0, lt=1.2)]
    rate_rad_s: Positive


class Brakes(Section):
    torque_n_m: Positive
    front_share: Share
    abs_slip: Positive


class Engine(Section):
    rpm: tuple[Positive, ...]
    torque_n_m: tuple[NotNegative, ...]
    braking_torque_n_m: NotNegative
    inertia_kg_m2: NotNegative
    launch_rpm: Positive
    shift_up_rpm: Positive
    shift_down_rpm: Positive
    shift_s: NotNegative
    traction_slip: Positive

    @model_validator(mode="after")
    def _curve(self) -> Engine:
        if len(self.rpm) < 2 or len(self.rpm) != len(self.torque_n_m):
            raise ValueError("rpm and torque_n_m must have the same length, at least 2")
        if any(b <= a for a, b in zip(self.rpm, self.rpm[1:], strict=False)):
            raise ValueError("rpm must rise from point to point")
        return self


class Gearbox(Section):
    ratios: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=10)]
    final_drive: Positive
    efficiency: Annotated[float, Field(gt=0, le=1)]
    front_share: Share  # of the torque: 0 drives the rear wheels, 1 the front ones
    differential_lock_n_m_s: NotNegative


class Fuel(Section):
    capacity_kg: Positive
    consumption_kg_j: NotNegative


class Wheel(Section):
    radius_m: Positive
    inertia_kg_m2: Positive
    rolling_resistance: NotNegative


class Tyre(Section):
    compound: str
    wear_j: Positive
    load_n: tuple[Positive, Positive]
    friction_longitudinal: tuple[Positive, Positive]
    friction_lateral: tuple[Positive, Positive]
    peak_slip_ratio: tuple[Positive, Positive]
    peak_slip_angle_rad: tuple[Positive, Positive]
    shape: Annotated[float, Field(gt=1, lt=2.5)]

    @model_validator(mode="after")
    def _loads(self) -> Tyre:
        if self.load_n[0] >= self.load_n[1]:
            raise ValueError("load_n must rise")
        return self


class Car(Section):
    """A car as its file describes it; see `sim/data/cars/gt3.toml` for the meaning of each field."""

    name: str
    description: str
    body: Body
    aero: Aero
    steering: Steering
    brakes: Brakes
    engine: Engine
    fuel: Fuel
    gearbox: Gearbox
    wheel: Wheel
    tyre: Tyre


class CarParameters(NamedTuple):
    """What the kernels read: plain SI numbers, and arrays where a quantity is a table."""

    dry_mass: float
    yaw_inertia: float
    half_length: float
    half_width: float
    a: float  # centre of mass to front axle
    b: float  # centre of mass to rear axle
    half_front_track: float
    half_rear_track: float
    height: float
    roll_front: float
    load_lag: float
    drag_area: float
    downforce_area: float
    downforce_front: float
    draught_drag: float
    draught_downforce: float
    full_lock: float
    steering_rate: float
    brake_torque_front: float  # a wheel
    brake_torque_rear: float
    abs_slip: float
    torque: NDArray[np.float64]  # (TORQUE_POINTS,) N m, evenly spaced from rpm 0 to rpm_max
    rpm_max: float
    engine_braking: float
    engine_inertia: float
    launch_rpm: float
    shift_up_rpm: float
    shift_down_rpm: float
    shift_time: float
    traction_slip: float
    ratios: NDArray[np.float64]  # overall, engine to wheel
    efficiency: float
    drive_front: float
    differential: float
    radius: float
    wheel_inertia: float
    rolling_resistance: float
    load_low: float
    friction_x: float  # at load_low, with slope per newton
    friction_x_slope: float
    friction_y: float
    friction_y_slope: float
    peak_x: float
    peak_x_slope: float
    peak_y: float
    peak_y_slope: float
    curve: NDArray[np.float64]  # (CELLS, 4) shape of the magic formula, see sim.tyre_curve
    wear_per_joule: float
    fuel_capacity: float
    fuel_per_joule: float


def parameters(car: Car, compound: str | None = None) -> CarParameters:
    """The kernel's view of a car on tyres of a compound, its own unless another is named.

    Raises:
        InputError: if there is no such compound.
    """
    grip, wear = compound_ratio(car.tyre.compound, compound or car.tyre.compound)
    body, aero, engine, gearbox, tyre = car.body, car.aero, car.engine, car.gearbox, car.tyre
    low, high = tyre.load_n

    def slope(values: tuple[float, float]) -> float:
        return (values[1] - values[0]) / (high - low)

    rpm_max = engine.rpm[-1]
    torque = np.interp(np.linspace(0.0, rpm_max, TORQUE_POINTS), engine.rpm, engine.torque_n_m)
    return CarParameters(
        dry_mass=body.mass_kg - car.fuel.capacity_kg,
        yaw_inertia=body.yaw_inertia_kg_m2,
        half_length=body.length_m / 2,
        half_width=body.width_m / 2,
        a=body.front_axle_m,
        b=body.rear_axle_m,
        half_front_track=body.front_track_m / 2,
        half_rear_track=body.rear_track_m / 2,
        height=body.centre_of_mass_height_m,
        roll_front=body.roll_stiffness_front_share,
        load_lag=body.load_transfer_lag_s,
        drag_area=aero.drag_area_m2,
        downforce_area=aero.downforce_area_m2,
        downforce_front=aero.downforce_front_share,
        draught_drag=aero.draught_drag_share,
        draught_downforce=aero.draught_downforce_share,
        full_lock=car.steering.full_lock_rad,
        steering_rate=car.steering.rate_rad_s,
        brake_torque_front=car.brakes.torque_n_m * car.brakes.front_share / 2,
        brake_torque_rear=car.brakes.torque_n_m * (1 - car.brakes.front_share) / 2,
        abs_slip=car.brakes.abs_slip,
        torque=torque,
        rpm_max=rpm_max,
        engine_braking=engine.braking_torque_n_m,
        engine_inertia=engine.inertia_kg_m2,
        launch_rpm=engine.launch_rpm,
        shift_up_rpm=engine.shift_up_rpm,
        shift_down_rpm=engine.shift_down_rpm,
        shift_time=engine.shift_s,
        traction_slip=engine.traction_slip,
        ratios=np.array(gearbox.ratios) * gearbox.final_drive,
        efficiency=gearbox.efficiency,
        drive_front=gearbox.front_share,
        differential=gearbox.differential_lock_n_m_s,
        radius=car.wheel.radius_m,
        wheel_inertia=car.wheel.inertia_kg_m2,
        rolling_resistance=car.wheel.rolling_resistance,
        load_low=low,
        friction_x=grip * tyre.friction_longitudinal[0],
        friction_x_slope=grip * slope(tyre.friction_longitudinal),
        friction_y=grip * tyre.friction_lateral[0],
        friction_y_slope=grip * slope(tyre.friction_lateral),
        peak_x=tyre.peak_slip_ratio[0],
        peak_x_slope=slope(tyre.peak_slip_ratio),
        peak_y=tyre.peak_slip_angle_rad[0],
        peak_y_slope=slope(tyre.peak_slip_angle_rad),
        curve=curve_cells(tyre.shape),
        wear_per_joule=wear / tyre.wear_j,
        fuel_capacity=car.fuel.capacity_kg,
        fuel_per_joule=car.fuel.consumption_kg_j,
    )


class Compound(Section):
    """A tyre compound: its grip and how fast it wears, against the others."""

    grip: Positive
    wear: Positive


class Compounds(Section):
    """All compounds by name."""

    compound: dict[str, Compound]


@lru_cache
def load_compounds() -> dict[str, Compound]:
    """The compounds that can be fitted, by name."""
    return read_toml(DATA / "compounds.toml", Compounds, "compounds").compound


def compound_ratio(base: str, fitted: str) -> tuple[float, float]:
    """Grip and wear of one compound as multiples of another's.

    Raises:
        InputError: if there is no such compound.
    """
    compounds = load_compounds()
    for name in (base, fitted):
        if name not in compounds:
            known = ", ".join(compounds)
            raise InputError(f"tyre compound {name!r} is unknown; expected one of {known}")
    return compounds[fitted].grip / compounds[base].grip, compounds[fitted].wear / compounds[base].wear


def read_car(path: Path) -> Car:
    """Read and check a car file.

    Raises:
        InputError: if the file cannot be read, or a field is missing, unknown or out of range.
    """
    return read_toml(path, Car, "car")


@lru_cache
def load_car(name: str) -> Car:
    """A car by its shipped name, or by the path of a `.toml` file.

    Raises:
        InputError: if there is no such car or its file is wrong.
    """
    return read_car(find_data(name, "car", DATA / "cars"))

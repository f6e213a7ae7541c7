"""Cars: data files with units in their field names, checked and turned into kernel parameters."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from nathlon.sim.data_file import DATA, Name, Section, find_data, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.tyre_curve import curve_cells

TORQUE_POINTS = 64
MOST_GEARS = 10

# Wide enough for a toy and for a road train: beyond, the steps of 1/60 s and the driver's tables do not hold.
Share = Annotated[float, Field(ge=0, le=1)]
Mass = Annotated[float, Field(ge=10, le=1e5)]
Inertia = Annotated[float, Field(ge=1, le=1e7)]
Length = Annotated[float, Field(ge=0.1, le=30)]
Area = Annotated[float, Field(ge=0, le=100)]
Torque = Annotated[float, Field(ge=0, le=1e6)]
Turns = Annotated[float, Field(ge=1, le=1e5)]
Slip = Annotated[float, Field(ge=0.001, le=1)]
Ratio = Annotated[float, Field(ge=0.01, le=100)]
Load = Annotated[float, Field(ge=1, le=1e6)]
Friction = Annotated[float, Field(ge=0.01, le=10)]


class Body(Section):
    mass_kg: Mass
    yaw_inertia_kg_m2: Inertia
    length_m: Length
    width_m: Length
    front_axle_m: Length
    rear_axle_m: Length
    front_track_m: Length
    rear_track_m: Length
    centre_of_mass_height_m: Annotated[float, Field(ge=0.01, le=5)]
    roll_stiffness_front_share: Share
    load_transfer_lag_s: Annotated[float, Field(ge=0.001, le=10)]


class Aero(Section):
    drag_area_m2: Area
    downforce_area_m2: Area
    downforce_front_share: Share
    draught_drag_share: Share
    draught_downforce_share: Share


class SteeringSystem(Section):
    full_lock_rad: Annotated[float, Field(ge=0.01, lt=1.2)]
    rate_rad_s: Annotated[float, Field(ge=0.01, le=100)]


class Brakes(Section):
    torque_n_m: Annotated[float, Field(ge=1, le=1e6)]
    front_share: Share
    abs_slip: Slip


class Engine(Section):
    rpm: tuple[Turns, ...]
    torque_n_m: tuple[Torque, ...]
    braking_torque_n_m: Torque
    inertia_kg_m2: Annotated[float, Field(ge=0, le=100)]
    launch_rpm: Turns
    shift_up_rpm: Turns
    shift_down_rpm: Turns
    shift_s: Annotated[float, Field(ge=0, le=10)]
    traction_slip: Slip

    @model_validator(mode="after")
    def _curve(self) -> Engine:
        if len(self.rpm) < 2 or len(self.rpm) != len(self.torque_n_m):
            raise ValueError("rpm and torque_n_m must have the same length, at least 2")
        if any(b <= a for a, b in zip(self.rpm, self.rpm[1:], strict=False)):
            raise ValueError("rpm must rise from point to point")
        return self


class Gearbox(Section):
    ratios: Annotated[tuple[Ratio, ...], Field(min_length=1, max_length=MOST_GEARS)]
    final_drive: Ratio
    efficiency: Annotated[float, Field(ge=0.01, le=1)]
    front_share: Share  # of the torque: 0 drives the rear wheels, 1 the front ones
    differential_lock_n_m_s: Annotated[float, Field(ge=0, le=1e6)]


class Fuel(Section):
    capacity_kg: Annotated[float, Field(ge=0.001, le=1e5)]
    consumption_kg_j: Annotated[float, Field(ge=0, le=1)]


class Wheel(Section):
    radius_m: Annotated[float, Field(ge=0.05, le=5)]
    inertia_kg_m2: Annotated[float, Field(ge=0.01, le=1e4)]
    rolling_resistance: Annotated[float, Field(ge=0, le=1)]


class Tyre(Section):
    compound: str
    wear_j: Annotated[float, Field(ge=1, le=1e15)]
    load_n: tuple[Load, Load]
    friction_longitudinal: tuple[Friction, Friction]
    friction_lateral: tuple[Friction, Friction]
    peak_slip_ratio: tuple[Slip, Slip]
    peak_slip_angle_rad: tuple[Slip, Slip]
    shape: Annotated[float, Field(ge=1.05, le=2.45)]

    @model_validator(mode="after")
    def _loads(self) -> Tyre:
        if self.load_n[0] >= self.load_n[1]:
            raise ValueError("load_n must rise")
        # From an unloaded tyre to the load beyond which nothing changes any more, see
        # `nathlon.sim.physics.tyre`.
        span = self.load_n[1] - self.load_n[0]
        ends = -self.load_n[0] / span, (2.0 * self.load_n[0] + 6000.0) / span
        for name in ("friction_longitudinal", "friction_lateral", "peak_slip_ratio", "peak_slip_angle_rad"):
            low, high = getattr(self, name)
            if min(low + (high - low) * end for end in ends) <= 0.0:
                raise ValueError(f"{name} falls below 0 at some load, expected less change with load_n")
        return self


class Car(Section):
    """A car as its file describes it; see `sim/data/cars/gt3.toml` for the meaning of each field."""

    name: Name
    description: str
    body: Body
    aero: Aero
    steering: SteeringSystem
    brakes: Brakes
    engine: Engine
    fuel: Fuel
    gearbox: Gearbox
    wheel: Wheel
    tyre: Tyre

    @model_validator(mode="after")
    def _weighs_more_than_its_fuel(self) -> Car:
        if self.fuel.capacity_kg >= self.body.mass_kg:
            raise ValueError("fuel.capacity_kg must be less than body.mass_kg, which it is part of")
        return self


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
    gears: int
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
    curve: NDArray[np.float64]  # (CELLS, 4) shape of the magic formula, see nathlon.sim.tyre_curve
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
        gears=len(gearbox.ratios),
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


def with_grip(car: Car, multiple: float) -> Car:
    """The car as if its tyres held a multiple of what they do: what it is on a wet road."""
    tyre = car.tyre

    def scaled(friction: tuple[float, float]) -> tuple[float, float]:
        return multiple * friction[0], multiple * friction[1]

    held = {
        "friction_longitudinal": scaled(tyre.friction_longitudinal),
        "friction_lateral": scaled(tyre.friction_lateral),
    }
    return car.model_copy(update={"tyre": tyre.model_copy(update=held)})


SLICK_MM = 0.35
"""Depth of water that a tyre without tread displaces."""


class Compound(Section):
    """A tyre compound.

    Attributes:
        grip, wear: how much it grips and how fast it wears, against the others, on dry road.
        film_mm: depth of water that it displaces, see `nathlon.sim.weather`.
        peak_slip: multiple of the car's slip at which its force peaks.
    """

    grip: Annotated[float, Field(gt=0, le=10)]
    wear: Annotated[float, Field(gt=0, le=1000)]
    film_mm: Annotated[float, Field(gt=0, le=100)] = SLICK_MM
    peak_slip: Annotated[float, Field(ge=0.2, le=5)] = 1.0

    @property
    def treaded(self) -> bool:
        """Whether it is for wet roads."""
        return self.film_mm > SLICK_MM


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

"""Tuning a car: the same car, heavier, stronger, on other tyres."""

from __future__ import annotations

from typing import NamedTuple

from nathlon.sim.car import Car, compound_ratio, with_grip
from nathlon.sim.data_file import checked


class Tuning(NamedTuple):
    """What to change of a car.

    Attributes:
        mass, power, drag, downforce: multiples of its own.
        balance: of the downforce, that goes from the rear to the front, as a share of all.
        gearing: multiple of the final drive; more is shorter gears.
        compound: of the tyres; None leaves them.
    """

    mass: float = 1.0
    power: float = 1.0
    drag: float = 1.0
    downforce: float = 1.0
    balance: float = 0.0
    gearing: float = 1.0
    compound: str | None = None


def tune(car: Car, tuning: Tuning) -> Car:
    """The car with some things changed.

    Ballast lies where the mass of the car does, so the yaw inertia grows with it. Power comes by torque.

    Raises:
        InputError: if there is no such compound, or a field goes out of its range.
    """
    fields = fit_compound(car, tuning.compound or car.tyre.compound).model_dump()
    body, aero, engine = fields["body"], fields["aero"], fields["engine"]
    body["mass_kg"] *= tuning.mass
    body["yaw_inertia_kg_m2"] *= tuning.mass
    engine["torque_n_m"] = [torque * tuning.power for torque in engine["torque_n_m"]]
    aero["drag_area_m2"] *= tuning.drag
    aero["downforce_area_m2"] *= tuning.downforce
    aero["downforce_front_share"] += tuning.balance
    fields["gearbox"]["final_drive"] *= tuning.gearing
    return checked(fields, Car, f"car {car.name!r} tuned")


def fit_compound(car: Car, compound: str) -> Car:
    """The car whose file would say that it comes on tyres of a compound.

    Raises:
        InputError: if there is no such compound.
    """
    if compound == car.tyre.compound:
        return car
    grip, wear = compound_ratio(car.tyre.compound, compound)
    fitted = with_grip(car, grip)
    worn = {"compound": compound, "wear_j": car.tyre.wear_j / wear}
    return fitted.model_copy(update={"tyre": fitted.tyre.model_copy(update=worn)})


def loosen(car: Car, peak_slip: float, shape: float | None = None) -> Car:
    """The car as on loose ground, where its tyres peak at a larger slip, and flatter.

    Brakes and traction are eased at a larger slip too (Pacejka, Tire and Vehicle Dynamics, 3rd edition,
    chapter 4, on the shape of the curve).

    Args:
        car: on a firm road.
        peak_slip: of the tyres, as a multiple of that.
        shape: of the magic formula; that of the car without one.

    Raises:
        InputError: if a field goes out of its range.
    """
    fields = car.model_dump()
    tyre, brakes, engine = fields["tyre"], fields["brakes"], fields["engine"]
    for name in ("peak_slip_ratio", "peak_slip_angle_rad"):
        tyre[name] = [slip * peak_slip for slip in tyre[name]]
    tyre["shape"] = shape or tyre["shape"]
    brakes["abs_slip"] *= peak_slip
    engine["traction_slip"] *= peak_slip
    return checked(fields, Car, f"car {car.name!r} on loose ground")

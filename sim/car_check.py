"""What is odd about a car whose file is right: what would make it no car, or hard to drive."""

from __future__ import annotations

import math
from itertools import pairwise

from nathlon.sim.car import Car

ROD = (0.6, 1.1)
"""A car's yaw inertia over that of a rod with its masses at the axles."""
LIGHTEST_AXLE = 0.35
"""Least share of the weight on an axle."""


def power_w(car: Car) -> float:
    """The engine's largest power, W."""
    points = zip(car.engine.rpm, car.engine.torque_n_m, strict=True)
    return max(rpm * torque for rpm, torque in points) * math.pi / 30.0


def in_short(car: Car) -> str:
    """Power, mass, driven wheels and tyres, in words."""
    driven = {0.0: "rear", 1.0: "front"}.get(car.gearbox.front_share, "all")
    power, mass = power_w(car) / 1000.0, car.body.mass_kg
    return f"{power:.0f} kW, {mass:.0f} kg, {driven}-wheel drive, {car.tyre.compound} tyres"


def oddities(car: Car) -> list[str]:
    """Sentences on what makes no sense, none for a sound car."""
    return [*_of_the_body(car), *_of_the_tyres(car), *_of_the_gears(car)]


def _of_the_body(car: Car) -> list[str]:
    body, said = car.body, []
    wheelbase = body.front_axle_m + body.rear_axle_m
    if wheelbase >= body.length_m:
        said.append(
            f"body.length_m is {body.length_m:g}, expected more than the wheelbase of {wheelbase:g} m"
        )
    rod = body.mass_kg * body.front_axle_m * body.rear_axle_m
    least, most = (share * rod for share in ROD)
    if not least < body.yaw_inertia_kg_m2 < most:
        said.append(
            f"body.yaw_inertia_kg_m2 is {body.yaw_inertia_kg_m2:g}, "
            f"expected {least:.0f} to {most:.0f} for its mass and axles"
        )
    front = body.rear_axle_m / wheelbase
    if not LIGHTEST_AXLE <= front <= 1.0 - LIGHTEST_AXLE:
        said.append(
            f"body.front_axle_m, body.rear_axle_m: {100 * front:.0f} % of the weight is in front, "
            f"expected {100 * LIGHTEST_AXLE:.0f} to {100 * (1.0 - LIGHTEST_AXLE):.0f} %"
        )
    if car.fuel.capacity_kg >= 0.1 * body.mass_kg:
        said.append(f"fuel.capacity_kg is {car.fuel.capacity_kg:g}, expected less than a tenth of the mass")
    return said


def _of_the_tyres(car: Car) -> list[str]:
    said = []
    for field in ("friction_longitudinal", "friction_lateral"):
        low, high = getattr(car.tyre, field)
        if not low * car.tyre.load_n[0] < high * car.tyre.load_n[1]:
            said.append(
                f"tyre.{field}: a tyre holds less the more it carries, expected less change with load"
            )
        if low <= high:
            said.append(f"tyre.{field}: rises with the load, expected that it falls")
    return said


def _of_the_gears(car: Car) -> list[str]:
    engine, ratios, said = car.engine, car.gearbox.ratios, []
    if any(lower <= higher for lower, higher in pairwise(ratios)):
        said.append("gearbox.ratios: expected that they fall from gear to gear")
    for gear, (lower, higher) in enumerate(pairwise(ratios), start=1):
        after = engine.shift_up_rpm * higher / lower
        if after <= engine.shift_down_rpm:
            said.append(
                f"gearbox.ratios: from gear {gear} the engine shifts up to {after:.0f} rpm, "
                f"expected more than engine.shift_down_rpm, {engine.shift_down_rpm:g}"
            )
    if engine.shift_up_rpm >= engine.rpm[-1]:
        said.append(f"engine.shift_up_rpm is {engine.shift_up_rpm:g}, expected less than {engine.rpm[-1]:g}")
    return said

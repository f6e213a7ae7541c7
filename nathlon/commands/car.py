"""`nathlon car check`, `nathlon car generate` and `nathlon car tune`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nathlon.commands.options import AsJson
from nathlon.selection.bounds import LARGEST_SEED
from nathlon.sim.process import typed
from nathlon.terminal import new_table, print_json, print_table, say, tell, warn

if TYPE_CHECKING:
    from nathlon.sim.car import Car

TOLD_M_S = (20, 40, 60, 80)
"""Speeds at which a car's grip is told."""
ODD = 1
"""Exit code for a car that makes no sense."""
Multiple = Annotated[float, typer.Option(min=0.1, max=10.0, help="Factor on the car's own value.")]


def check_car(
    name: Annotated[str, typer.Argument(help="Name or path of the car.")], as_json: AsJson = False
) -> None:
    """Check a car's file, and say what the car can do. Exit code 1 if something makes no sense."""
    from nathlon.sim.car import load_car
    from nathlon.sim.car_check import oddities, power_w

    car = load_car(name)
    odd = oddities(car)
    grip = _grip(car)
    if as_json:
        print_json(
            {"name": car.name, "description": car.description, "power_w": power_w(car), "odd": odd, **grip}
        )
    else:
        power, mass = power_w(car), car.body.mass_kg
        say(f"{car.name}: {car.description}")
        say(
            f"{power / 1000:.0f} kW, {mass:.0f} kg, {power / mass:.0f} W/kg, {3.6 * grip['top_m_s']:.0f} km/h"
        )
        table = new_table("Accelerations, m/s²", ("At km/h", "Cornering", "Braking", "Driving"))
        for row in zip(
            TOLD_M_S, grip["cornering_m_s2"], grip["braking_m_s2"], grip["driving_m_s2"], strict=True
        ):
            table.add_row(f"{3.6 * row[0]:.0f}", *(f"{value:.1f}" for value in row[1:]))
        print_table(table)
        for sentence in odd:
            warn(f"nathlon: {name}: {sentence}")
    if odd:
        raise typer.Exit(ODD)


def generate_car(
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the car.")],
    out: Annotated[Path, typer.Option("--out", help="Folder that the car's file goes into.")] = Path(),
    as_json: AsJson = False,
) -> None:
    """Make up a car between road car and prototype, as car-SEED.toml; the same seed gives the same car."""
    from nathlon.sim.car_family import generate_car as generate

    _write(generate(seed), out, as_json)


def tune_car(
    car: Annotated[str, typer.Argument(help="Name or path of the car.")],
    name: Annotated[str, typer.Option(help="Name of the tuned car: lowercase letters, digits, hyphens.")],
    mass: Multiple = 1.0,
    power: Multiple = 1.0,
    drag: Multiple = 1.0,
    downforce: Multiple = 1.0,
    balance: Annotated[
        float, typer.Option(min=-0.5, max=0.5, help="Share of the downforce on the front axle.")
    ] = 0.0,
    gearing: Multiple = 1.0,
    compound: Annotated[str | None, typer.Option(help="Tyres that the car starts on.")] = None,
    out: Annotated[Path, typer.Option("--out", help="Folder that the car's file goes into.")] = Path(),
    as_json: AsJson = False,
) -> None:
    """Make a car of another one, as NAME.toml: heavier, stronger, on other tyres."""
    from nathlon.sim.car import load_car
    from nathlon.sim.car_check import in_short
    from nathlon.sim.names import check_new_name
    from nathlon.sim.tuning import Tuning, tune

    check_new_name(name)
    tuned = tune(load_car(car), Tuning(mass, power, drag, downforce, balance, gearing, compound))
    _write(tuned.model_copy(update={"name": name, "description": in_short(tuned)}), out, as_json)


def _write(car: Car, out: Path, as_json: bool) -> None:
    from nathlon.sim.car_family import write_car

    path = out / f"{car.name}.toml"
    write_car(path, car)
    if as_json:
        print_json({"car": path, "description": car.description})
        return
    say(f"Car          {path}: {car.description}")
    tell({"check": typed("car", "check", path), "race": typed("race", "driver", "--car", path)}, False)


def _grip(car: Car) -> dict[str, Any]:
    """Top speed, and accelerations at the speeds told, on a level road."""
    import numpy as np

    from nathlon.policies.driver.envelope import SPEEDS, WEIGHTS, envelope
    from nathlon.sim.physics.chassis import GRAVITY

    limits = envelope(car)
    level = int(np.abs(WEIGHTS - GRAVITY).argmin())
    driving = np.minimum(limits.power, limits.traction[:, level, 0]) - limits.drag
    braking = limits.brake[:, level, 0] + limits.drag
    rows = np.searchsorted(SPEEDS, TOLD_M_S)
    return {
        "top_m_s": float(SPEEDS[driving > 0.0].max(initial=0.0)),
        "cornering_m_s2": limits.corner[rows, level].tolist(),
        "braking_m_s2": braking[rows].tolist(),
        "driving_m_s2": driving[rows].tolist(),
    }

"""Driving aids, and that scripted people who see late can drive with them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from benchmarks.scripted_drivers import KEYS, UNAIDED, WHEEL, Style, built_in_driver_alone, drive_alone
from nathlon.lab.drive.aids import BRAKE_S, STEER_S, THROTTLE_S, AidedCar, Aids, Controls
from nathlon.sim.car import load_car
from nathlon.sim.clock import DYNAMICS_HZ
from tests.support.drives import CIRCUITS
from tests.support.driving import GT3, circle, world_with

alone, best_alone = cache(drive_alone), cache(built_in_driver_alone)
OFF = Aids(steering=False, pedals=False)


# Keys on the short circuits alone: 50 decisions a second along the longest take as long as all else here.
@pytest.mark.parametrize(
    ("style", "share", "circuit"),
    [
        *(pytest.param(KEYS, 1.15, circuit, id=f"keys-{circuit}") for circuit in CIRCUITS[:2]),
        *(pytest.param(WHEEL, 1.07, circuit, id=f"wheel-{circuit}") for circuit in CIRCUITS),
    ],
)
def test_who_sees_late_laps_within_its_share_and_stays_on_the_course(
    style: Style, share: float, circuit: str
) -> None:
    lap, best = alone(circuit, "gt3", style), best_alone(circuit, "gt3")
    assert lap["ending"] == "finished"
    assert lap["off_course_s"] == 0.0
    assert lap["race_time_s"] < share * best["race_time_s"]


def test_without_aids_it_is_harder_but_not_impossible() -> None:
    lap, aided = alone("lindenring", "gt3", UNAIDED), alone("lindenring", "gt3", WHEEL)
    assert (lap["ending"], lap["off_course_s"]) == ("finished", 0.0)
    assert lap["race_time_s"] > aided["race_time_s"]
    assert drive_alone("lindenring", "gt3", WHEEL._replace(aids=False))["off_course_s"] > 0.0


def car_on_a_circle(speed: float) -> np.void:
    return world_with(circle(80.0), [0.0], speed=speed).state[0, 0]


def test_keys_take_their_time_and_a_wheel_does_not() -> None:
    car, aided = car_on_a_circle(20.0), AidedCar(GT3, OFF)
    done = [aided.act(Controls(True, 1.0, 1.0, 0.0), car) for _ in range(DYNAMICS_HZ)]
    throttle, steering = np.array(done).T
    assert np.argmax(steering == 1.0) == pytest.approx(STEER_S * DYNAMICS_HZ, abs=1.5)
    assert np.argmax(throttle == 1.0) == pytest.approx(THROTTLE_S * DYNAMICS_HZ, abs=1.5)
    assert AidedCar(GT3, OFF).act(Controls(False, 0.3, 0.0, 0.7), car) == (-0.7, 0.3)


def test_a_key_that_is_let_go_lets_the_brake_go() -> None:
    car, aided = car_on_a_circle(20.0), AidedCar(GT3, OFF)
    for _ in range(round(BRAKE_S * DYNAMICS_HZ) + 1):
        pedals, _ = aided.act(Controls(True, 0.0, 0.0, 1.0), car)
    assert pedals == -1.0
    for _ in range(6):
        pedals, _ = aided.act(Controls(True, 0.0, 0.0, 0.0), car)
    assert pedals == 0.0


@pytest.mark.parametrize("speed", [20.0, 40.0, 70.0])
def test_all_steering_never_slips_the_front_tyres_beyond_their_peak(speed: float) -> None:
    """A car on a straight that steers with all there is, from the first step on."""
    world = world_with(circle(5000.0, half_width=200.0, wall=400.0), [0.0], speed=speed)
    aided, peaks = AidedCar(GT3, Aids()), []
    for _ in range(2 * DYNAMICS_HZ):
        own = world.state[0, 0]
        world.step(np.array([[aided.act(Controls(False, 1.0, 0.0, 0.0), own)]]), 1)
        peaks.append(np.abs(own["slip_angle"][:2]).mean())
    assert max(peaks) < 1.1 * max(GT3.tyre.peak_slip_angle_rad)
    # The car turns, and does not spin.
    assert own["yaw_rate"] > 0.05
    assert abs(own["slip_angle"][2:]).max() < 1.5 * max(GT3.tyre.peak_slip_angle_rad)


def test_brakes_are_eased_in_a_bend_and_not_on_a_straight() -> None:
    aided = AidedCar(load_car("gt3"), Aids())
    straight = world_with(circle(5000.0), [0.0], speed=40.0).state[0, 0]
    assert aided.act(Controls(False, 0.0, 0.0, 1.0), straight)[0] == pytest.approx(-1.0, abs=0.01)
    bend = straight.copy()
    bend["yaw_rate"] = 0.8 * aided.grip_m_s2(40.0) / 40.0
    assert -0.7 < aided.act(Controls(False, 0.0, 0.0, 1.0), bend)[0] < -0.3
    bend["slip_angle"][2:] = 0.3
    assert aided.act(Controls(False, 0.0, 0.0, 1.0), bend)[0] == 0.0

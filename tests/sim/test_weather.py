"""Weather: the balance of the water, the grip in it, and races without any."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.sim.car import load_car, load_compounds
from nathlon.sim.conditions import Conditions
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.scenario import Scenario, load_scenario
from nathlon.sim.service import Service
from nathlon.sim.track import load_track
from nathlon.sim.weather import (
    DRAINAGE_S,
    EVAPORATION_MM_H,
    SPRAY_MM_H,
    Shower,
    Weather,
    draw,
    film_after,
    wet_share,
)
from nathlon.sim.world import World

TRACK, CAR = load_track("lindenring"), load_car("gt3")
SHOWER = Weather(shower=(Shower(time_s=2.0, rain_mm_h=36.0), Shower(time_s=7.0, rain_mm_h=0.0)))


def started(conditions: Conditions, cars: int = 3) -> World:
    world = World(TRACK, CAR, 1, cars, conditions)
    start = load_scenario(f"grand_prix:cars={cars}").place(TRACK, np.random.default_rng(1))
    world.reset(0, start)
    return world


def driven(conditions: Conditions) -> dict[str, NDArray[np.float64]]:
    """Ten seconds of three cars that slide about, (steps, 1, 3, ..) by name of what is noted."""
    world, noted = started(conditions), defaultdict(list)
    for tick in range(100):
        actions = np.zeros((1, 3, 2))
        actions[0, :, 0] = 1.0, 0.6, np.sin(tick / 5)
        actions[0, :, 1] = 0.1 * np.sin(tick / 9), -0.05, 0.3 * np.sin(tick / 4)
        world.step(actions)
        for name in ("x", "y", "yaw", "spin", "slip_ratio", "wear", "fuel"):
            noted[name].append(world.state[name].copy())
    return {name: np.array(values) for name, values in noted.items()}


def test_the_water_follows_its_closed_form() -> None:
    """Through a shower and after it, whatever the steps."""
    drying = EVAPORATION_MM_H + SPRAY_MM_H * 3 / (TRACK.length / 1000.0)
    wet, dry = (DRAINAGE_S * (rain - drying) / 3600.0 for rain in (36.0, 0.0))
    shower = wet * (1.0 - math.exp(-5.0 / DRAINAGE_S))
    for substeps in (6, 12, 60):
        world = started(Conditions(weather=(SHOWER,)))
        while world.time[0] < 6.99:
            world.step(np.zeros((1, 3, 2)), substeps)
        assert world.state["film"][0, 0] == pytest.approx(shower, rel=1e-9)
        while world.time[0] < 9.99:
            world.step(np.zeros((1, 3, 2)), substeps)
        after = dry + (shower - dry) * math.exp(-3.0 / DRAINAGE_S)
        assert world.state["film"][0, 0] == pytest.approx(after, rel=1e-9)
    assert film_after(1.0, 0.0, 0.0, 1e5) == 0.0
    halves = film_after(film_after(0.2, 5.0, 2.0, 70.0), 5.0, 2.0, 30.0)
    assert halves == pytest.approx(film_after(0.2, 5.0, 2.0, 100.0), rel=1e-12)


def test_compounds_cross_over_where_they_should() -> None:
    """From slicks to intermediates at a tenth of a millimetre, from those to wets at some 0.3."""
    known = load_compounds()

    def best(film_mm: float) -> str:
        names = ("racing-medium", "intermediate", "wet")
        grips = {name: known[name].grip * wet_share(film_mm, known[name].film_mm) for name in names}
        return max(grips, key=lambda name: float(grips[name]))

    assert [best(film) for film in (0.0, 0.07, 0.15, 0.25, 0.45, 2.0)] == [
        "racing-medium",
        "racing-medium",
        "intermediate",
        "intermediate",
        "wet",
        "wet",
    ]


def test_tyres_have_grip_and_peak_of_their_kind_in_the_wet() -> None:
    world = started(Conditions(weather=(Weather(),), film_mm=0.5))
    world.fit(0, 1, Service("wet"))
    world.step(np.zeros((1, 3, 2)), 1)
    slick, wet = world.state[0, 0], world.state[0, 1]
    assert wet["tyre_grip"] * wet["wet_grip"] > 1.2 * slick["tyre_grip"] * slick["wet_grip"]
    assert slick["wet_peak"] == slick["wet_grip"] < 0.6
    assert wet["wet_peak"] == pytest.approx(1.2 * wet["wet_grip"])


def test_brakes_hold_less_on_a_wet_road_with_treads_more_than_without() -> None:
    speeds = []
    for film, compound in ((0.0, "racing-medium"), (0.6, "wet"), (0.6, "racing-medium")):
        world = started(Conditions(weather=(Weather(),), film_mm=film), 1)
        world.fit(0, 0, Service(compound))
        for _ in range(10):
            world.step(np.array([[[-1.0, 0.0]]]))
        speeds.append(float(world.state["velocity_x"][0, 0]))
    assert speeds == sorted(speeds)
    assert speeds[2] > speeds[1] + 0.5 > speeds[0] + 1.0


DRY = {
    (0.0, 0.0): ((171.38041, 10.11315), (239.25305, -11.65193), (2.96770, 7.43759)),
    (5.0, 1.0): ((169.28884, 7.35313), (235.31316, -11.57491), (2.87125, 7.46449)),
}
"""Where the cars of `driven` ended before there was weather, m, by rates of wear and fuel."""


@pytest.mark.parametrize("rates", DRY)
def test_races_without_weather_are_what_they_were(rates: tuple[float, float]) -> None:
    wear, fuel = rates
    dry = driven(Conditions(wear_rate=wear, fuel_rate=fuel))
    # Processors of another kind round otherwise.
    np.testing.assert_allclose(np.stack([dry["x"], dry["y"]], -1)[-1, 0], DRY[rates], atol=1e-3)
    # A sky from which nothing falls is as good as none.
    cloudy = driven(Conditions(wear_rate=wear, fuel_rate=fuel, weather=(Weather(),)))
    for name, values in dry.items():
        np.testing.assert_array_equal(cloudy[name], values)


def test_policies_that_are_told_the_car_see_the_grip() -> None:
    spec = ObservationSpec(version=3)
    names = [field.name for field in spec.fields]
    assert "car" in names
    dry, wet = (
        started(Conditions(weather=(Weather(),), film_mm=film)).observe(
            spec, np.zeros(1, int), np.zeros(1, int)
        )
        for film in (0.0, 0.4)
    )
    plain = started(Conditions()).observe(spec, np.zeros(1, int), np.zeros(1, int))
    assert np.array_equal(dry, plain)
    changed = np.flatnonzero(dry[0] != wet[0])
    # Friction and slip at its peak, each along and across, at two loads.
    assert len(changed) == 8
    assert (wet[0, changed] < dry[0, changed]).all()


def rainy(**changes: object) -> Scenario:
    return load_scenario("grand_prix_rain").model_copy(update=changes)


def test_the_seed_of_a_race_decides_its_weather() -> None:
    scenario = rainy()
    skies = [scenario.place(TRACK, np.random.default_rng(seed)).sky for seed in range(60)]
    assert skies == [scenario.place(TRACK, np.random.default_rng(seed)).sky for seed in range(60)]
    assert skies.count(0) > skies.count(1) > 0 < skies.count(2)
    # Where there is no choice nothing is drawn: starts stay what they were.
    rng = np.random.default_rng(1)
    assert draw((Weather(),), rng) == 0
    assert rng.bit_generator.state == np.random.default_rng(1).bit_generator.state


def test_a_shower_may_come_with_a_lap() -> None:
    shower = Weather(shower=(Shower(lap=2, rain_mm_h=4.0),))
    assert [shower.rain_mm_h(50.0, lap) for lap in (1, 2, 3)] == [0.0, 4.0, 4.0]
    world = started(Conditions(weather=(shower,)))
    world.state["progress"][0, 2] = TRACK.length + 1.0
    assert world.rain_mm_h(0) == 4.0


def test_what_has_not_rained_is_no_longer_forecast() -> None:
    dry, early = Weather(), Weather(shower=(Shower(time_s=60.0, rain_mm_h=4.0),))
    assert dry.agrees(early, 59.0, 1)
    assert not dry.agrees(early, 60.0, 1)
    assert early.agrees(replace_shower(early), 60.0, 1)


def replace_shower(weather: Weather) -> Weather:
    """The same until now, and more to come."""
    return Weather(shower=(*weather.shower, Shower(time_s=600.0, rain_mm_h=0.0)))


def test_a_shower_has_one_moment_and_water_needs_weather() -> None:
    with pytest.raises(ValueError, match="expected either time_s or lap"):
        Shower(rain_mm_h=1.0)
    with pytest.raises(ValueError, match="expected weather beside it"):
        Scenario.model_validate(load_scenario("race").model_dump() | {"film_mm": 1.0})
    with pytest.raises(InputError, match="race ends at a line, expected one that ends by time"):
        load_scenario("race:hours=2")
    assert load_scenario("endurance:hours=0.5").time_s == 1800.0

"""The planner where it may rain: on which tyres it starts, when it stops for others, and when it does not."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from nathlon.policies.stint_model import CompoundLaps, StintModel, in_water, with_treads
from nathlon.policies.stint_planner import StintPlanner
from nathlon.sim.weather import Shower, Weather, film_after, films_ahead
from tests.policies.test_stint_planner import LAPS, MODEL, wall

LAP_S, USED_KG = 100.0, 2.0
SLICK = CompoundLaps(
    name="racing-medium",
    lap_s=tuple((LAP_S + 0.2 * np.arange(LAPS)).tolist()),
    used_kg=(USED_KG,) * LAPS,
    wear=tuple((0.05 * np.arange(1, LAPS + 1)).tolist()),
)
LASTING = StintModel(fuel_s_kg=0.0, stop_s=15.0, compound=(SLICK,))
"""Tyres for which nobody stops on dry road."""
DRY = Weather()


def rain(lap: int, mm_h: float, until: int | None = None, chance: float = 1.0) -> Weather:
    """Rain that begins with a lap of the leader, and ends with another."""
    ends = [] if until is None else [Shower(lap=until, rain_mm_h=0.0)]
    return Weather(chance=chance, shower=(Shower(lap=lap, rain_mm_h=mm_h), *ends))


def raced(forecast: tuple[Weather, ...], came: int = 0, film_mm: float = 0.0) -> list[tuple[int, str]]:
    """Tyres with the laps after which they are fitted, in a race that the model drives alone."""
    planner, compounds = StintPlanner(LASTING), {one.name: one for one in with_treads(LASTING).compound}
    time_s, age, fitted = 0.0, 0, []
    for lap in range(LAPS):
        left = tuple(one for one in forecast if one.agrees(forecast[came], time_s, lap + 1))
        whole = sum(one.chance for one in left)
        known: dict[str, Any] = {
            "film_mm": film_mm,
            "time_s": time_s,
            "forecast": tuple(one.model_copy(update={"chance": one.chance / whole}) for one in left),
            "laps_done": np.array([lap]),
        }
        if lap == 0:
            fitted.append((0, str(planner.start(wall(0, **known)).compound)))
        name = fitted[-1][1]
        wear = float(compounds[name].wear[age - 1]) if age else 0.0
        stop = planner.decide(wall(lap, compounds=(name,), wear=np.full(4, wear), **known))
        films = films_ahead(forecast[came], film_mm, 0.0, time_s, lap + 1, 1, lambda _: LAP_S)
        time_s += compounds[name].lap_s[age] * in_water([name], films).mean()
        film_mm = film_after(films[0, -1], forecast[came].rain_mm_h(time_s, lap + 1), 0.0, LAP_S / films.size)
        age += 1
        if stop is not None:
            fitted.append((lap + 1, str(stop.compound)))
            age = 0
    return fitted


def test_a_road_that_stays_wet_is_worth_a_stop_as_soon_as_it_is() -> None:
    """From the third lap on: heavy rain makes it wet within that lap, light rain later."""
    assert raced((rain(3, 20.0),)) == [(0, "racing-medium"), (2, "wet")]
    assert raced((rain(3, 5.0),)) == [(0, "racing-medium"), (3, "intermediate")]


def test_nobody_stops_for_a_shower_that_is_over_before_the_tyres_pay() -> None:
    assert raced((rain(3, 5.0, until=4),)) == [(0, "racing-medium")]


def test_on_a_drying_road_slicks_are_fitted_where_no_other_lap_is_faster() -> None:
    """As known by trying every lap."""
    [start, (lap, back)] = raced((DRY,), film_mm=0.6)
    assert (start, back) == ((0, "intermediate"), "racing-medium")
    assert lap == min(range(1, LAPS), key=dried)


def dried(stop: int) -> float:
    """What a race on intermediates takes that ends on slicks, from a lap on."""
    before, after = (with_treads(LASTING).compound[i] for i in (1, 0))
    films = films_ahead(DRY, 0.6, 0.0, 0.0, 1, LAPS, lambda _: LAP_S)
    taken = 0.0
    for lap in range(LAPS):
        tyres, age = (before, lap) if lap < stop else (after, lap - stop)
        taken += tyres.lap_s[age] * in_water([tyres.name], films[lap]).mean()
    return taken


@pytest.mark.parametrize(("chance", "tyres"), [(0.9, "wet"), (0.1, "racing-medium")])
def test_tyres_at_the_start_are_those_that_are_best_in_the_mean(chance: float, tyres: str) -> None:
    shower = Shower(time_s=1.0, rain_mm_h=14.0)
    forecast = Weather(chance=chance, shower=(shower,)), Weather(chance=1.0 - chance)
    assert raced(forecast)[0] == (0, tyres)


def test_what_fell_decides_which_weather_counts() -> None:
    """A shower that does not pay and rain that does begin alike: at the end of that lap it is known which."""
    forecast = rain(3, 4.0, until=5), rain(3, 14.0, until=8), DRY
    assert [raced(forecast, came) for came in range(3)] == [
        [(0, "racing-medium")],
        [(0, "racing-medium"), (3, "wet")],
        [(0, "racing-medium")],
    ]


def test_a_forecast_of_dry_weather_changes_no_decision() -> None:
    """Nor does one of rain of which there is none: whatever tyres, fuel and laps there are."""
    planner, rng = StintPlanner(MODEL), np.random.default_rng(1)
    none = rain(2, 6.0).with_share(0.0)
    for lap, late, worn, fuel_kg in product((0, 4, 8, 11), (0, 1), (0.2, 0.9), (5.0, 60.0)):
        wear, name = worn * rng.uniform(0.9, 1.1, 4), str(rng.choice(["racing-soft", "racing-hard"]))
        dry = wall(lap, ends_lap=lap + late, wear=wear, fuel_kg=fuel_kg, compounds=(name,))
        assert planner.decide(dry._replace(forecast=(none, DRY))) == planner.decide(dry)
    assert planner.start(wall(0, forecast=(none, DRY))) == planner.start(wall(0))

"""The planner: what it starts on, when it stops, and what it does where its plan does not come out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nathlon.policies.load import load_policy
from nathlon.policies.sources.composite import Composite
from nathlon.policies.sources.identity import policy_id
from nathlon.policies.stint_model import CompoundLaps, StintModel
from nathlon.policies.stint_planner import StintPlanner
from nathlon.policies.stint_search import SPARE_KG
from nathlon.policies.strategy import PitWall
from nathlon.sim.rules import PitParameters
from tests.support.refusals import refusal

USED_KG = 4.0
SLOWER_S = 1.0
LAPS = 12


def compound(name: str, fresh_s: float, slower_s: float, wear: float) -> CompoundLaps:
    ages = np.arange(10)
    return CompoundLaps(
        name=name,
        lap_s=tuple((fresh_s + slower_s * ages).tolist()),
        used_kg=(USED_KG,) * 10,
        wear=tuple((wear * (ages + 1)).tolist()),
    )


MODEL = StintModel(
    fuel_s_kg=0.03,
    stop_s=12.0,
    compound=(compound("racing-soft", 100.0, SLOWER_S, 0.1), compound("racing-hard", 102.0, 0.5, 0.06)),
)


def wall(lap: int, laps: int | None = LAPS, **known: Any) -> PitWall:
    facts: dict[str, Any] = {
        "car": 0,
        "laps": laps,
        "lap": lap,
        "ends_lap": lap + 1,
        "wear": np.zeros(4),
        "fuel_kg": 60.0,
        "last_lap_s": np.zeros(1),
        "gap_s": np.zeros(1),
        "compounds": ("racing-soft",),
        "laps_done": np.array([lap]),
        "stops": np.zeros(1, int),
        "pit": PitParameters(8.0, 2.5, False),
        "tank_kg": 80.0,
        "penalty_s": np.zeros(1),
    }
    return PitWall(**facts | known)


def driven(planner: StintPlanner, wear: float = 0.1) -> tuple[list[int], float]:
    """Laps after which it stops, and what a race on soft tyres takes that wear by `wear` a lap, s."""
    fuel_kg, worn, total, stops = planner.start(wall(0)).fuel_kg or 80.0, 0.0, 0.0, []
    for lap in range(LAPS):
        asked = planner.decide(wall(lap, wear=np.full(4, worn), fuel_kg=fuel_kg))
        total += 100.0 + SLOWER_S * worn / 0.1 + 0.03 * fuel_kg
        fuel_kg -= USED_KG
        worn += wear
        assert fuel_kg > 0.0
        if asked:
            added = max((asked.fuel_kg or 0.0) - fuel_kg, 0.0)
            stops.append(lap + 1)
            worn, fuel_kg, total = 0.0, fuel_kg + added, total + 12.0 + 8.0 + added / 2.5
    return stops, total


def seconds(stops: tuple[int, ...]) -> float:
    """What a race on soft tyres takes at least with stops after these laps, begun with fuel up to one."""
    return min(begun(stops, lap) for lap in (*stops, LAPS))


def begun(stops: tuple[int, ...], until: int) -> float:
    """The same with fuel from the start until a lap, and later as each stint needs."""
    total, fuel, ends = 0.0, until * USED_KG + SPARE_KG, (*stops, LAPS)
    for begin, end in zip((0, *stops), ends, strict=True):
        length = end - begin
        added = max(length * USED_KG + SPARE_KG - fuel, 0.0)
        fuel += added
        total += sum(100.0 + SLOWER_S * i + 0.03 * (fuel - USED_KG * i) for i in range(length))
        fuel -= length * USED_KG
        if begin:
            total += 12.0 + 8.0 + added / 2.5
    return total


SOFT = StintPlanner(MODEL.model_copy(update={"compound": MODEL.compound[:1]}))


def test_a_race_as_expected_takes_no_longer_than_in_any_stints() -> None:
    """Nor with any fuel: carrying it is cheaper here than filling it in."""
    ways = [(), *((i,) for i in range(2, 11)), *((i, j) for i in range(1, 11) for j in range(i + 1, 12))]
    best = min(seconds(way) for way in ways if max(np.diff([0, *way, LAPS])) <= 10)
    assert driven(SOFT)[1] == pytest.approx(best, abs=0.1)


def test_tyres_that_wear_faster_than_practised_are_changed_earlier() -> None:
    assert driven(SOFT, wear=0.17)[0][0] < driven(SOFT)[0][0]


def test_nobody_stops_on_the_last_lap() -> None:
    """Not with tyres that are gone, and not with a tank that is empty."""
    for worn in ({"wear": np.ones(4)}, {"fuel_kg": 0.1}):
        assert StintPlanner(MODEL).decide(wall(LAPS - 1, **worn)) is None


def test_whoever_runs_out_of_fuel_stops_at_once() -> None:
    service = StintPlanner(MODEL).decide(wall(5, fuel_kg=USED_KG + 0.2))
    assert service is not None
    assert service.fuel_kg is not None
    assert service.fuel_kg >= 2 * USED_KG


def test_a_stop_that_was_missed_is_asked_for_again() -> None:
    planner, gone = StintPlanner(MODEL), np.full(4, 1.0)
    assert planner.decide(wall(5, wear=gone)) is not None
    assert planner.decide(wall(6, wear=gone)) is not None


def test_tyres_of_an_unknown_compound_and_races_without_laps_are_planned_too() -> None:
    planner = StintPlanner(MODEL)
    assert planner.decide(wall(3, compounds=("sports-hard",), wear=np.ones(4))) is not None
    assert planner.start(wall(0, None)).compound is not None
    assert planner.decide(wall(200, None, wear=np.ones(4))) is not None
    assert planner.decide(wall(200, None)) is None


def test_an_entry_after_the_line_is_for_this_lap() -> None:
    """There a stop on the last lap is a stop with a lap to go: too late for new tyres, not for fuel."""
    last = {"lap": LAPS - 1, "ends_lap": LAPS - 1}
    assert StintPlanner(MODEL).decide(wall(**last)) is None
    assert StintPlanner(MODEL).decide(wall(**last, fuel_kg=1.0)) is not None


PLANNER = """
[planner]
fuel_s_kg = 0.03
stop_s = 12.0
[[planner.compound]]
name = "racing-soft"
lap_s = [100.0, 101.0]
used_kg = [4.0, 4.0]
wear = [0.1, 0.2]
"""


def written(folder: Path, text: str) -> str:
    path = folder / "planner.toml"
    path.write_text(f'name = "one"\n[[part]]\npolicy = "driver:pace=0.9"\n{text}', "utf-8")
    return str(path)


def test_a_composite_has_a_planner_as_its_strategist(tmp_path: Path) -> None:
    plain = policy_id(written(tmp_path, ""))
    source = written(tmp_path, PLANNER)
    policy = load_policy(source, "lindenring", "gt3")
    assert isinstance(policy, Composite)
    assert isinstance(policy.strategist, StintPlanner)
    assert policy_id(source) not in (plain, policy_id(written(tmp_path, PLANNER.replace("12.0", "13.0"))))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (PLANNER + "[[stint]]\nlaps = 3\n", "stint and planner are two strategies, expected one of them"),
        (PLANNER.replace("racing-soft", "butter"), "planner.compound.0.name is 'butter': .*expected one of"),
        (PLANNER.replace("[4.0, 4.0]", "[4.0]"), "lap_s, used_kg and wear must be equally long"),
        (PLANNER.replace("[0.1, 0.2]", "[0.2, 0.1]"), "wear must not fall from lap to lap"),
        (PLANNER + PLANNER[PLANNER.index("[[") :], "a compound comes twice, expected each once"),
    ],
)
def test_a_faulty_model_is_named(tmp_path: Path, text: str, complaint: str) -> None:
    source = written(tmp_path, text)
    with refusal(Path(source), complaint):
        load_policy(source, "lindenring", "gt3")

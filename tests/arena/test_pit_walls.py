"""Strategies in races: plans are driven as they are written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.arena.match import Match, Race, Seat, Swap
from nathlon.arena.pit_walls import Advised, PitWalls
from nathlon.arena.runner import run_match, run_until
from nathlon.arena.stints import DrivenStint, read
from nathlon.arena.watch import Watch
from nathlon.policies.bundled import champion
from nathlon.policies.load import load_policy
from nathlon.policies.sources.composite import Composite
from nathlon.policies.sources.identity import policy_id
from nathlon.policies.sources.strategist import OwnStrategist
from nathlon.policies.strategy import PitWall, Stint, StintPlan
from nathlon.sim.car import load_car
from nathlon.sim.conditions import Conditions
from nathlon.sim.rules import PitParameters
from nathlon.sim.scenario import load_scenario
from nathlon.sim.service import Service
from nathlon.sim.track import load_track
from nathlon.sim.weather import Shower, Weather
from nathlon.sim.world import World
from tests.support.refusals import refusal

PART = '[[part]]\npolicy = "driver:pace=0.9"\n'
SOFT = '[[stint]]\nlaps = 1\ncompound = "racing-soft"\nfuel_kg = 20\n'
HARD = '[[stint]]\nlaps = 1\ncompound = "racing-hard"\nfuel_kg = 25\n'


def written(folder: Path, text: str, name: str = "plan") -> str:
    path = folder / f"{name}.toml"
    path.write_text(f'name = "{name}"\n{text}', "utf-8")
    return str(path)


def wall(stops: int, ends_lap: int) -> PitWall:
    nothing = np.zeros(1)
    return PitWall(
        car=0,
        laps=9,
        lap=ends_lap - 1,
        ends_lap=ends_lap,
        wear=np.zeros(4),
        fuel_kg=10.0,
        last_lap_s=nothing,
        gap_s=nothing,
        compounds=("racing-soft",),
        laps_done=np.zeros(1, int),
        stops=np.array([stops]),
        pit=PitParameters(8.0, 2.5, False),
        tank_kg=80.0,
        penalty_s=np.zeros(1),
    )


def test_a_plan_stops_at_the_end_of_each_stint_but_the_last() -> None:
    plan = StintPlan([Stint(laps=3, compound="racing-soft"), Stint(laps=2, fuel_kg=30), Stint(laps=4)])
    assert plan.start(wall(0, 1)) == Service("racing-soft", None)
    asked = [plan.decide(wall(stops, lap)) for stops, lap in ((0, 2), (0, 3), (1, 4), (1, 5), (2, 9))]
    assert asked == [None, Service(None, 30.0), None, Service(), None]


def test_a_stop_that_was_missed_is_due_a_lap_later() -> None:
    plan = StintPlan([Stint(laps=3), Stint(laps=9)])
    assert plan.decide(wall(0, 4)) == Service()


def test_nobody_stops_on_the_last_lap() -> None:
    plan = StintPlan([Stint(laps=8), Stint(laps=4)])
    assert plan.decide(wall(0, 8)) == Service()
    assert plan.decide(wall(0, 9)) is None


def test_a_race_is_driven_by_its_plans(tmp_path: Path) -> None:
    """One stops after a lap, the other never; both start as they said."""
    sources = (written(tmp_path, PART + SOFT + HARD, "one"), written(tmp_path, PART + HARD, "none"))
    match = Match(
        "race",
        "stops",
        "grand_prix_stops:laps=2,cars=2",
        "lindenring",
        "gt3",
        ("one", "none"),
        sources,
        (Race(1, (Seat(0), Seat(1))),),
    )
    policies = [load_policy(source, "lindenring", "gt3") for source in sources]
    worlds: list[World] = []
    grips = []

    def look(world: World) -> None:
        worlds.append(world)
        grips.append(world.state["tyre_grip"][0].copy())

    results = run_match(match, policies, look)
    assert results["ending"].to_list() == ["finished", "finished"]
    assert worlds[-1].state["stops"][0].tolist() == [1, 0]
    assert grips[0].tolist() == [1.04, 0.96]
    assert grips[-1].tolist() == [0.96, 0.96]
    assert worlds[-1].state["fuel"][0, 0] < 25.0
    (soft, hard), [only] = (read(text) for text in results["stints"])
    assert (soft.compound, soft.laps, hard.compound, hard.laps) == ("racing-soft", 1, "racing-hard", 1)
    assert soft.stood_s == pytest.approx(worlds[-1].state["stood_s"][0, 0], abs=1e-3)
    assert soft.lane_s == pytest.approx(worlds[-1].state["lane_s"][0, 0], abs=1e-3)
    assert soft.stood_s is not None
    assert soft.lane_s is not None
    assert 8.0 < soft.stood_s < soft.lane_s - 20.0
    assert (only, hard.stood_s, hard.lane_s) == (DrivenStint("racing-hard", 2), None, None)


class Listening:
    """A strategist that keeps what it is told."""

    def __init__(self) -> None:
        self.walls: list[PitWall] = []

    def start(self, wall: PitWall) -> Service:
        self.walls.append(wall)
        return Service("intermediate")

    def decide(self, wall: PitWall) -> Service | None:
        self.walls.append(wall)
        return None

    def pace(self, wall: PitWall) -> float:
        return 1.0


def test_a_pit_wall_knows_the_road_and_what_may_come() -> None:
    """And goes on where its notes end."""
    weather = (
        Weather(chance=3.0),
        Weather(shower=(Shower(time_s=60.0, rain_mm_h=5.0),)),
        Weather(shower=(Shower(time_s=0.0, rain_mm_h=2.0),)),
    )
    track, strategist = load_track("lindenring"), Listening()
    world = World(track, load_car("gt3"), 1, 1, Conditions(weather=weather, film_mm=0.2))
    world.reset(0, load_scenario("stint").place(track, np.random.default_rng(1)))
    advised = [Advised(0, 0, 0, 0, strategist)]
    walls = PitWalls(world, None, advised, Watch())
    world.step(np.array([[[0.5, 0.0]]]))
    world.state["progress"] = 1.0
    walls.listen()
    started, first = strategist.walls
    assert (started.film_mm, started.rain_mm_h, started.time_s) == (0.2, 0.0, 0.0)
    assert first.time_s == pytest.approx(0.1)
    assert first.cars_per_km == pytest.approx(1000.0 / track.length)
    # The shower that would have begun by now has not.
    assert [one.chance for one in first.forecast] == [0.75, 0.25]
    assert [one.shower for one in first.forecast] == [weather[0].shower, weather[1].shower]
    again = PitWalls(world, None, advised, Watch(), walls.notes)
    assert again.notes == walls.notes
    again.listen()
    assert len(strategist.walls) == 2, "the lap has begun before"


def test_a_pit_wall_changes_hands_with_the_wheel(tmp_path: Path) -> None:
    """One plans a stop after a lap and one does not; during that lap each takes the other's place."""
    scenario, sources = (
        "grand_prix_stops:laps=2,cars=2",
        ("driver:pace=0.9", written(tmp_path, PART + SOFT + HARD)),
    )
    match = Match(
        "race",
        "swaps",
        scenario,
        "lindenring",
        "gt3",
        ("driver", "plan"),
        sources,
        (Race(1, (Seat(0), Seat(1))),),
    )
    policies = [load_policy(source, "lindenring", "gt3") for source in sources]

    def raced(swap: Swap | None) -> tuple[dict[float, bytes], list[int], list[list[DrivenStint]]]:
        worlds: list[World] = []
        moved: dict[float, bytes] = {}

        def look(world: World) -> None:
            worlds.append(world)
            moved[float(world.time[0])] = world.state[["x", "y", "yaw", "fuel", "asked"]].tobytes()

        results = run_match(replace(match, swap=swap), policies, look)
        return moved, worlds[-1].state["stops"][0].tolist(), [read(text) for text in results["stints"]]

    original, stops, stints = raced(None)
    assert stops == [0, 1]
    for car, stops_then in ((0, [1, 1]), (1, [0, 0])):
        moved, stops, stints = raced(Swap(0, car, 1 - car, 60.0))
        assert stops == stops_then
        until = max(time_s for time_s, state in moved.items() if original.get(time_s) == state)
        assert until == pytest.approx(60.0)
        assert all(original[time_s] == state for time_s, state in moved.items() if time_s <= until)
        if car == 0:
            assert [(one.compound, one.laps) for one in stints[0]] == [
                ("racing-medium", 1),
                ("racing-hard", 1),
            ]
    halt, _ = run_until(replace(match, swap=Swap(0, 0, 1, 0.0)), policies, Watch(), 1.0)
    assert halt.races.cars["tyre_grip"][0].tolist() == [1.04, 1.04], "from the start it starts as it says"


def test_who_takes_its_own_place_is_not_asked_again(tmp_path: Path) -> None:
    """A strategist may answer otherwise within the lap, and the race would be another one."""
    source, ids = written(tmp_path, PART), ("own", "own")
    policies = [load_policy(source, "lindenring", "gt3") for _ in ids]
    told = [Listening(), Listening()]
    for policy, strategist in zip(policies, told, strict=True):
        assert isinstance(policy, Composite)
        policy.strategist = strategist
    races, swap = (Race(1, (Seat(0),)),), Swap(0, 0, 1, 1.0)
    match = Match("race", "again", "stint:laps=1", "lindenring", "gt3", ids, (source,) * 2, races, swap=swap)
    run_until(match, policies, Watch(), 2.0)
    assert [len(one.walls) for one in told] == [2, 0]


class Failing:
    """A user's strategist that fits a car, and then raises."""

    def start(self, wall: PitWall) -> Service:
        return Service("racing-hard")

    def decide(self, wall: PitWall) -> Service | None:
        raise ValueError("no idea")


def test_a_car_whose_strategist_fails_is_out_and_the_others_race_on(
    caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    source, ids = written(tmp_path, PART), ("failing", "none")
    races = (Race(1, (Seat(0), Seat(1))),)
    match = Match("race", "fails", "stint:laps=1,cars=2", "lindenring", "gt3", ids, (source,) * 2, races)
    failing, other = (load_policy(source, "lindenring", "gt3") for _ in ids)
    assert isinstance(failing, Composite)
    failing.strategist = OwnStrategist("Failing", Failing())
    results = run_match(match, [failing, other]).sort("entrant")
    assert results["ending"].to_list() == ["policy_raised", "finished"]
    assert "strategist Failing: decide raised ValueError (no idea): its car is out" in caplog.text


PLANNED = Path(__file__).parents[2] / "benchmarks/ladders/generalist/generalist-racer-007k.safetensors"
LAP = "[[stint]]\nlaps = 1\n"


@pytest.mark.parametrize("policy", ["driver", str(PLANNED)])
def test_a_car_drives_each_stint_at_its_pace(tmp_path: Path, policy: str) -> None:
    part = f'[[part]]\npolicy = "{policy}"\n'
    sources = written(tmp_path, f"{part}{LAP}pace = 0.8\n{LAP}", "slow"), written(tmp_path, part + LAP + LAP)
    races = tuple(Race(1, (Seat(entrant),)) for entrant in range(2))
    match = Match("race", "pace", "stint:laps=2", "lindenring", "gt3", ("slow", "plan"), sources, races)
    paces: list[NDArray[np.float64]] = []
    slow, free = run_match(
        match,
        [load_policy(source, "lindenring", "gt3") for source in sources],
        lambda world: paces.append(world.state["pace"][:, 0].copy()),
    )["race_time_s"]
    assert paces[0].tolist() == [0.8, 1.0]
    assert paces[-1].tolist() == [1.0, 1.0]
    assert slow - free == pytest.approx(0.25 * free / 2, rel=0.3)


def test_who_takes_no_pace_is_told_none(tmp_path: Path) -> None:
    policy = champion("lindenring", "gt3")
    source = written(tmp_path, f'[[part]]\npolicy = "{policy}"\n{LAP}pace = 0.9\n')
    with refusal(
        Path(source), f"pace: {policy} takes none, expected the built-in driver or a policy that sees"
    ):
        load_policy(source, "lindenring", "gt3")


def test_a_pace_is_part_of_the_entrant_unless_it_is_all(tmp_path: Path) -> None:
    ids = [policy_id(written(tmp_path, PART + LAP + pace)) for pace in ("", "pace = 1.0\n", "pace = 0.9\n")]
    assert ids[0] == ids[1] != ids[2]


def test_a_strategy_is_part_of_the_entrant(tmp_path: Path) -> None:
    plans = [PART, PART + SOFT, PART + SOFT + HARD]
    assert len({policy_id(written(tmp_path, plan, str(i))) for i, plan in enumerate(plans)}) == 3


@pytest.mark.parametrize(
    ("stint", "complaint"),
    [
        ("laps = 1\npace = 0.3", "field stint.0.pace is 0.3: .*greater than or equal to 0.5"),
        ("laps = 0", "field stint.0.laps is 0: .*greater than or equal to 1"),
        (
            'laps = 1\ncompound = "butter"',
            "field stint.0.compound is 'butter': .*expected one of comfort-hard",
        ),
        ("laps = 1\nfuel_kg = -1", "field stint.0.fuel_kg is -1: .*greater than or equal to 0"),
        ("laps = 1\nfuel = 1", "field stint.0.fuel is unknown; expected one of compound, fuel_kg, laps"),
    ],
)
def test_a_faulty_stint_is_named(tmp_path: Path, stint: str, complaint: str) -> None:
    source = written(tmp_path, f"{PART}[[stint]]\n{stint}\n")
    with refusal(Path(source), complaint):
        load_policy(source, "lindenring", "gt3")


def test_a_plan_for_a_longer_race_makes_no_stop_in_the_last_lap() -> None:
    plan = StintPlan([Stint(laps=9, compound="racing-soft"), Stint(laps=9)])
    assert plan.decide(wall(0, 9)) is None

"""Plans in sight: the driver's, for the grip that there is, and one that a policy has practised."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nathlon.policies import bundled
from nathlon.policies.checkpoint import load_checkpoint, read_checkpoint, save_checkpoint
from nathlon.policies.driver import practised, shown_plan
from nathlon.policies.driver.shown_plan import Practiser, own_plan, plan_of, show_plans
from nathlon.policies.policy import Policy, StatelessPolicy
from nathlon.policies.training.evaluation import evaluate_laps
from nathlon.policies.training.pairs import Pair
from nathlon.sim.car import Car, compound_ratio, load_car
from nathlon.sim.conditions import Conditions
from nathlon.sim.observation import ANY_CAR, PLANNED, ObservationSpec
from nathlon.sim.physics.course import SurfaceGrip
from nathlon.sim.plan import CURVATURE, DIRECTION, OFFSET, SPEED, Plan, X, Y
from nathlon.sim.track import Track, load_track
from nathlon.sim.world import World

TRACK, CAR = load_track("lindenring"), load_car("gt3")
GENERALIST = bundled.generalist()


def test_it_is_what_the_driver_follows() -> None:
    line, table = practised(TRACK, CAR), plan_of(TRACK, CAR).table
    assert np.array_equal(table[:-1, SPEED], line.speed)
    assert np.array_equal(table[:-1, OFFSET], line.offset)
    # The table closes: its last row is the first one, a turn later.
    assert np.array_equal(np.delete(table[-1], DIRECTION), np.delete(table[0], DIRECTION))
    assert abs(table[-1, DIRECTION] - table[0, DIRECTION]) == pytest.approx(2.0 * np.pi)
    # Place, direction and curvature are of one line, but for what differences round off in 2 m.
    x, y = np.diff(table[:, [X, Y]], axis=0).T
    middle = 0.5 * (table[1:, DIRECTION] + table[:-1, DIRECTION])
    off = np.arctan2(y, x) - middle
    assert np.abs(np.arctan2(np.sin(off), np.cos(off))).max() < 0.01
    turned = np.diff(table[:, DIRECTION]) / np.hypot(x, y)
    np.testing.assert_allclose(turned, table[:-1, CURVATURE], atol=5e-3)


def _seer(spec: ObservationSpec) -> Policy:
    return StatelessPolicy(spec, lambda seen: np.zeros((len(seen), 2), np.float32))


def test_it_is_made_once_for_those_who_see_it_and_for_the_grip_that_there_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[Car] = []

    def noted(track: Track, car: Car) -> Plan:
        asked.append(car)
        return Plan(np.zeros((len(track.table) + 1, 8)))

    monkeypatch.setattr(shown_plan, "plan_of", noted)
    conditions = Conditions(compound="racing-soft", grip=SurfaceGrip(tarmac=0.7))
    world = World(TRACK, CAR, 1, 1, conditions)
    blind, seeing = (_seer(ObservationSpec(version=version)) for version in (ANY_CAR, PLANNED))
    show_plans(world, blind)
    assert not world.plans
    for _ in range(2):
        show_plans(world, blind, seeing)
    assert world.plans
    [car] = asked
    grip = 0.7 * compound_ratio(CAR.tyre.compound, "racing-soft")[0]
    assert car.tyre.friction_lateral[0] == pytest.approx(grip * CAR.tyre.friction_lateral[0])


def test_who_practises_drives_its_own_plan_faster_and_stays_on_the_road(tmp_path: Path) -> None:
    card, tensors = read_checkpoint(GENERALIST)
    cautious = card.model_copy(update={"practises": False})
    own = card.model_copy(update={"practises": True})
    trials = []
    for name, told in (("cautious", cautious), ("own", own)):
        path = tmp_path / f"{name}.safetensors"
        save_checkpoint(path, {key: np.asarray(value, np.float32) for key, value in tensors.items()}, told)
        policy = load_checkpoint(path)
        trials.append(evaluate_laps(Pair("lindenring", "gt3"), policy, 1))
    assert trials[1].lap_s < 0.99 * trials[0].lap_s
    assert trials[1].off_course_share == 0.0
    # Elsewhere than the driver it must slow down or may be faster, on the same line.
    plans = plan_of(TRACK, CAR).table, own_plan(TRACK, CAR, Practiser(policy.id, policy)).table
    assert np.array_equal(plans[0][:, OFFSET], plans[1][:, OFFSET])
    share = plans[1][:, SPEED] / plans[0][:, SPEED]
    assert share.min() < 0.995
    assert share.max() > 1.005


def test_each_sees_what_it_has_practised_and_all_others_the_drivers(monkeypatch: pytest.MonkeyPatch) -> None:
    def of(speed: float) -> Plan:
        return Plan(np.full((len(TRACK.table) + 1, 8), speed))

    monkeypatch.setattr(shown_plan, "plan_of", lambda track, car: of(0.0))
    monkeypatch.setattr(shown_plan, "own_plan", lambda track, car, practiser: of(float(practiser.id)))
    specs = [ObservationSpec(version=PLANNED, practised_by=hand) for hand in ("", "1", "2")]
    world = World(TRACK, CAR, 1, 3)
    show_plans(world, *map(_seer, specs), _seer(specs[1]))
    assert {hand: plan.table[0, SPEED] for hand, (plan,) in world.plans.items()} == {"": 0, "1": 1, "2": 2}

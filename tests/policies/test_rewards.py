"""Reward components over hand-made arrays of transitions, and over steps of a world."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from nathlon.policies.training import rewards
from nathlon.policies.training.rewards import Reward, RewardWeights
from nathlon.sim.car import load_car
from nathlon.sim.episode import Episodes
from nathlon.sim.errors import InputError
from nathlon.sim.instruments import Instruments
from nathlon.sim.scenario import load_scenario
from nathlon.sim.state import CAR_STATE, CONTACT, OTHER, REAR_END, SIDE_SWIPE
from nathlon.sim.track import load_track
from tests.support.driving import stadium, world_with

DT = 0.1
LAP_M = 1000.0
TRACK = load_track("lindenring")
INSTRUMENTS = Instruments(TRACK, load_car("gt3"), DT)
CHICANE = next(i for i, section in enumerate(TRACK.sections) if section.name == "Schikane")
NO_CONTACTS = np.zeros(0, CONTACT), np.zeros(0, np.int64)


def cars(**fields: list[Any]) -> NDArray[np.void]:
    """One race of cars whose named fields have these values, one a car; the others are 0."""
    state = np.zeros((1, len(next(iter(fields.values())))), CAR_STATE)
    state["driving"] = True
    for name, values in fields.items():
        state[name][0] = values
    return state


def test_progress_is_metres_gained_and_masked_off_course() -> None:
    before, after = cars(progress=[10.0, 990.0]), cars(progress=[14.0, 994.5])
    assert rewards.progress(before, after)[0].tolist() == [4.0, 4.5]
    after["off_course"][0, 0] = True
    assert rewards.progress(before, after)[0].tolist() == [0.0, 4.5]


def test_off_course_and_wall_are_charged_on_the_speed_before_the_step() -> None:
    before = cars(velocity_x=[40.0, 30.0], velocity_y=[0.0, -40.0], off_course_s=[1.0, 1.0])
    after = before.copy()
    after["velocity_x"] = after["velocity_y"] = 0.0
    after["off_course_s"][0, 0] += DT
    after["wall_s"][0, 1] += DT
    assert rewards.off_course(before, after)[0] == pytest.approx([-DT * 1600.0, 0.0])
    assert rewards.off_course(before, after, np.array([[2.0, 1.0]]))[0] == pytest.approx([-DT * 3200.0, 0.0])
    assert rewards.wall(before, after)[0] == pytest.approx([0.0, -DT * 2500.0])


def test_touches_cost_one_each() -> None:
    after = cars(wall_contact=[1, 0, 0], car_contact=[0, 1, 1])
    assert rewards.wall_touch(after)[0].tolist() == [-1.0, 0.0, 0.0]
    assert rewards.contact(after)[0].tolist() == [0.0, -1.0, -1.0]


def test_tyre_slip_caps_the_slip_ratio() -> None:
    after = cars(slip_ratio=[[0.5] * 4, [-3.0] * 4], slip_angle=[[0.1] * 4, [0.1, -0.1, 0.1, -0.1]])
    assert rewards.tyre_slip(after)[0] == pytest.approx([-0.2, -0.4])


class TestPassing:
    def test_ground_gained_is_ground_lost_by_the_other(self) -> None:
        before, after = cars(progress=[100.0, 82.0]), cars(progress=[104.0, 86.5])
        assert rewards.passing(before, after, LAP_M)[0] == pytest.approx([-0.5, 0.5])

    @pytest.mark.parametrize(
        ("gap", "counts"), [(39.0, True), (41.0, False), (-19.0, True), (-21.0, False), (0.0, True)]
    )
    def test_it_counts_from_20_m_behind_to_40_m_ahead(self, gap: float, counts: bool) -> None:
        before = cars(progress=[100.0, 100.0 + gap])
        after = cars(progress=[105.0, 104.0 + gap])
        assert rewards.passing(before, after, LAP_M)[0, 0] == pytest.approx(1.0 if counts else 0.0)

    def test_cars_meet_across_the_line_and_laps_apart(self) -> None:
        before, after = cars(progress=[995.0, 3005.0]), cars(progress=[1000.0, 3009.0])
        assert rewards.passing(before, after, LAP_M)[0] == pytest.approx([1.0, -1.0])

    def test_each_of_several_counts_but_none_that_is_out(self) -> None:
        before = cars(progress=[100.0, 110.0, 120.0, 90.0])
        after = cars(progress=[105.0, 114.0, 123.0, 90.0])
        before["driving"][0, 3] = False
        assert rewards.passing(before, after, LAP_M)[0, 0] == pytest.approx(1.0 + 2.0)


def note(
    geometry: int,
    fault: int = -1,
    section: int = -1,
    behind: int = 1,
    ahead: int = 0,
    faster: int = 1,
    relative: tuple[float, float] = (3.0, 4.0),
) -> NDArray[np.void]:
    """A contact in a section of lindenring."""
    contact = np.zeros(1, CONTACT)
    contact["geometry"], contact["fault"], contact["faster"] = geometry, fault, faster
    contact["behind"], contact["ahead"] = behind, ahead
    contact["section_behind"] = contact["section_ahead"] = section
    contact["relative_x"], contact["relative_y"] = relative
    return contact


def test_rear_end_charges_only_the_faster_car_behind() -> None:
    race = np.zeros(1, np.int64)
    for behind, faster, charged in ((1, 1, [0.0, -25.0]), (0, 0, [-25.0, 0.0]), (1, 0, [0.0, 0.0])):
        contact = note(REAR_END, behind=behind, ahead=1 - behind, faster=faster)
        assert rewards.rear_end(contact, race, (1, 2))[0] == pytest.approx(charged)
    twice = np.concatenate([note(OTHER), note(OTHER, relative=(1.0, 0.0))])
    assert rewards.rear_end(twice, np.array([1, 1]), (2, 2))[1] == pytest.approx([0.0, -26.0])


STRAIGHT, CURVE, OUTSIDE = 0, 1, -1
CURVED = np.array([False, True, False])


@pytest.mark.parametrize(
    ("geometry", "section", "fault", "charged"),
    [
        (REAR_END, STRAIGHT, 1, [0.0, -1.0]),
        (REAR_END, STRAIGHT, -1, [0.0, -1.0]),
        (REAR_END, CURVE, 1, [0.0, -1.0]),
        (REAR_END, OUTSIDE, 1, [0.0, -1.0]),
        (SIDE_SWIPE, STRAIGHT, 0, [-1.0, 0.0]),
        (SIDE_SWIPE, STRAIGHT, 1, [0.0, -1.0]),
        (SIDE_SWIPE, OUTSIDE, -1, [-1.0, -1.0]),
        (SIDE_SWIPE, CURVE, 0, [-1.0, -1.0]),
        (OTHER, STRAIGHT, -1, [0.0, 0.0]),
        (OTHER, CURVE, -1, [-1.0, -1.0]),
    ],
)
def test_unsporting(geometry: int, section: int, fault: int, charged: list[float]) -> None:
    contact = note(geometry, fault, section)
    assert rewards.unsporting(contact, np.zeros(1, np.int64), CURVED, (1, 2))[0].tolist() == charged


def test_unsporting_looks_at_the_section_of_each_car() -> None:
    contact = note(OTHER)
    contact["section_ahead"] = CURVE
    assert rewards.unsporting(contact, np.zeros(1, np.int64), CURVED, (1, 2))[0].tolist() == [-1.0, 0.0]


class TestReward:
    def test_total_is_the_weighted_sum(self) -> None:
        weights = RewardWeights(progress=2.0, off_course=0.0, wall=0.0, wall_touch=0.0, passing=1.0)
        reward = Reward(weights, INSTRUMENTS)
        before, after = cars(progress=[100.0, 90.0]), cars(progress=[104.0, 95.0])
        components = reward.components(before, after, *NO_CONTACTS)
        assert reward.total(components)[0] == pytest.approx([2.0 * 4.0 - 1.0, 2.0 * 5.0 + 1.0])
        assert set(components) == set(RewardWeights.model_fields) - {"off_course_in", "expression"}

    def test_off_course_counts_more_in_named_sections(self) -> None:
        reward = Reward(RewardWeights(off_course_in={"Schikane": 2.0}), INSTRUMENTS)
        middle = TRACK.sections[CHICANE].start_m + 20.0
        before = cars(velocity_x=[10.0, 10.0], row=[int(middle / TRACK.spacing), 0])
        after = before.copy()
        after["off_course_s"] = DT
        components = reward.components(before, after, *NO_CONTACTS)
        assert components["off_course"][0] == pytest.approx([-20.0, -10.0])

    def test_a_curve_is_what_the_circuit_calls_no_straight(self) -> None:
        reward = Reward(RewardWeights(), INSTRUMENTS)
        state = cars(progress=[100.0, 90.0])
        straight = next(i for i, section in enumerate(TRACK.sections) if section.kind == "straight")
        for section, charged in ((straight, [0.0, 0.0]), (CHICANE, [-1.0, -1.0]), (-1, [0.0, 0.0])):
            contact = note(OTHER, section=section)
            components = reward.components(state, state, contact, np.zeros(1, np.int64))
            assert components["unsporting"][0].tolist() == charged

    def test_a_section_that_the_circuit_lacks_is_refused(self) -> None:
        with pytest.raises(InputError, match=r"off_course_in.Eau Rouge is not a section of lindenring"):
            Reward(RewardWeights(off_course_in={"Eau Rouge": 2.0}), INSTRUMENTS)

    def test_a_push_from_behind_in_the_world_is_noticed(self) -> None:
        world = world_with(stadium(), [1300.0, 1294.0], speed=[40.0, 50.0])
        before = world.state.copy()
        for _ in range(3):
            world.step(np.zeros((1, 2, 2)))
            if world.contact_count[0]:
                break
        contacts = world.new_contacts(0)
        components = Reward(RewardWeights(), Instruments(world.track, world.car, DT)).components(
            before, world.state, contacts, np.zeros(len(contacts), np.int64)
        )
        assert components["unsporting"][0].tolist() == [0.0, -1.0]
        assert components["rear_end"][0] == pytest.approx([0.0, -100.0], rel=0.1)
        assert components["contact"][0].tolist() == [-1.0, -1.0]
        assert components["at_fault"][0].tolist() == [0.0, -1.0]

    def test_an_expression_stands_alone_or_beside_the_weights_that_are_given(self) -> None:
        text = "0.1 * progress / m - 2 * (lateral > 3 * m)"
        before, after = cars(progress=[100.0, 90.0]), cars(progress=[104.0, 95.0], lateral=[0.0, 4.0])
        after["wall_contact"] = True
        cases: list[tuple[dict[str, Any], float]] = [({}, 0.0), ({"wall_touch": 0.5}, -0.5)]
        for weights, beside in cases:
            reward = Reward(RewardWeights.model_validate({"expression": text} | weights), INSTRUMENTS)
            components = reward.components(before, after, *NO_CONTACTS)
            assert components["expression"][0] == pytest.approx([0.4, -1.5])
            assert reward.total(components)[0] == pytest.approx([0.4 + beside, -1.5 + beside])

    def test_a_reward_is_a_pure_number_that_changes(self) -> None:
        for text, sentence in (
            ("speed", "column 1: the expression is in m/s, expected a pure number"),
            ("2 + 3", "column 1: the expression is the same always"),
            ("speed / (m/s) + sped", "column 17: 'sped' is no quantity, expected one like speed"),
        ):
            with pytest.raises(ValidationError, match=re.escape(sentence)):
                RewardWeights(expression=text)

    def test_weights_with_an_expression_survive_the_file_of_a_run(self) -> None:
        weights = RewardWeights(expression="progress / m", passing=0.3)
        assert RewardWeights.model_validate_json(weights.model_dump_json()) == weights


@pytest.mark.parametrize("delay_s", [0.0, 0.05, 0.1])
def test_no_contact_is_missed_whatever_the_delay(delay_s: float) -> None:
    """With a delay of half a step the world steps twice a step, and keeps only the last one's contacts."""
    scenario = load_scenario("1v1").model_copy(update={"perception_delay_s": delay_s})
    episodes = Episodes("lindenring", "gt3", scenario, races=24)
    races = range(24)
    episodes.start(races, [np.random.default_rng(race) for race in races])
    found = np.zeros((24, 2), np.int64)
    actions = np.broadcast_to(np.array([[1.0, 0.0], [1.0, 0.02]], np.float32), (24, 2, 2))
    for _ in range(100):
        episodes.step(actions)
        for role in ("behind", "ahead"):
            np.add.at(found, (episodes.contact_races, episodes.contacts[role]), 1)
    np.testing.assert_array_equal(found, episodes.world.state["contacts"])
    assert found.sum() > 0

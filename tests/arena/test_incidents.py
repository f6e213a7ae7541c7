"""What the stewards see is told in their words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nathlon.arena.incidents import IncidentWatch
from nathlon.arena.race_log import Incident
from nathlon.sim.rules import load_rules
from nathlon.sim.state import OTHER, REAR_END, SIDE_SWIPE
from nathlon.sim.track import load_track
from nathlon.sim.world import World
from tests.support.driving import start_at, world_with

TRACK = load_track("lindenring")
BETWEEN = "between Lange Gerade and Haarnadel"
HAIRPIN = [section.name for section in TRACK.sections].index("Haarnadel")


@pytest.fixture
def world() -> World:
    """Two cars in the hairpin."""
    start, end = TRACK.stretch("Haarnadel")
    return world_with(TRACK, [(start + end) / 2, (start + end) / 2 - 10.0])


@pytest.fixture
def watch(world: World) -> IncidentWatch:
    watch = IncidentWatch(0, ["ann", "bob"], load_rules("sporting"), TRACK)
    watch.see(world)
    assert watch.incidents == []
    return watch


@pytest.mark.parametrize(
    ("geometry", "fault", "sections", "penalty_s", "text"),
    [
        (REAR_END, 1, (6, 6), 3.0, "2 bob runs into the rear of 1 ann at 4.2 m/s in Haarnadel: 3 s penalty"),
        (REAR_END, -1, (6, 6), 0.0, "2 bob touches the rear of 1 ann at 4.2 m/s in Haarnadel"),
        (SIDE_SWIPE, 0, (5, 6), 1.5, f"1 ann moves across into 2 bob at 4.2 m/s {BETWEEN}: 1.5 s penalty"),
        (SIDE_SWIPE, -1, (-1, 6), 0.0, "2 bob and 1 ann touch side by side at 4.2 m/s in Haarnadel"),
        (OTHER, -1, (-1, -1), 0.0, "2 bob and 1 ann collide at 4.2 m/s at 2000 m"),
    ],
)
def test_contacts(
    world: World,
    watch: IncidentWatch,
    geometry: int,
    fault: int,
    sections: tuple[int, int],
    penalty_s: float,
    text: str,
) -> None:
    assert HAIRPIN == 6
    contact = world.contacts[0, 0]
    contact["time"], contact["behind"], contact["ahead"], contact["closing"] = 7.25, 1, 0, 4.2
    contact["geometry"], contact["fault"], contact["penalty_s"] = geometry, fault, penalty_s
    contact["section_behind"], contact["section_ahead"] = sections
    world.contact_count[0] = 1
    world.state[0, 1]["progress"] = TRACK.length + 2000.0
    if fault >= 0:
        world.state[0, fault]["penalties"] += 1
    watch.see(world)
    cars = (int(text[0]) - 1, 2 - int(text[0]))
    [incident] = watch.incidents
    assert incident.closing_m_s == pytest.approx(4.2)
    assert replace(incident, closing_m_s=4.2) == Incident(7.25, "contact", cars, text, fault, 4.2, penalty_s)


def test_penalties_for_leaving_the_course(world: World, watch: IncidentWatch) -> None:
    """Three warnings are free; a cut counts without a warning; both may come with a contact."""
    ann = world.state[0, 0]
    for warnings, penalties in ((3, 0), (4, 1), (4, 2), (6, 4)):
        ann["warnings"], ann["penalties"], ann["penalty_s"] = warnings, penalties, penalties
        watch.see(world)
    assert [incident.text for incident in watch.incidents] == [
        "1 ann has left the course 4 times, now in Haarnadel: 1 s penalty",
        "1 ann cuts the course in Haarnadel: 2 s penalty",
        "1 ann has left the course 6 times, now in Haarnadel: 1 s penalty",
    ]
    assert {incident.kind for incident in watch.incidents} == {"penalty"}
    assert [incident.penalty_s for incident in watch.incidents] == [1.0, 2.0, 1.0]
    ann["penalty_s"] = 0.0
    watch.see(world)
    watch.see(world)
    assert [incident.text for incident in watch.incidents[3:]] == ["1 ann has served its penalties"]


def test_a_long_excursion_is_told_once_and_a_later_one_again(world: World, watch: IncidentWatch) -> None:
    for second in (1.0, 1.1, 1.2, 2.1, 5.0):
        world.ticks[0] = round(60 * second)
        world.state[0, 1]["off_course"] = True
        watch.see(world)
        world.state[0, 1]["off_course"] = False
        world.ticks[0] += 1
        watch.see(world)
    assert [(incident.time_s, incident.text) for incident in watch.incidents] == [
        (1.0, "2 bob leaves the course in Haarnadel"),
        (5.0, "2 bob leaves the course in Haarnadel"),
    ]


def test_what_is_seen_of_a_drive_is_what_happened() -> None:
    """A car that drives straight into the wall of a bend leaves the course before it hits the wall."""
    start, _ = TRACK.stretch("Haarnadel")
    world = world_with(TRACK, [start])
    world.reset(0, start_at([start], speed=30.0))
    watch = IncidentWatch(0, ["ann"], load_rules("sporting"), TRACK)
    for _ in range(60):
        world.step(np.zeros((1, 1, 2)))
        watch.see(world)
    first, second = watch.incidents[:2]
    assert (first.kind, second.kind) == ("off_course", "wall")
    assert second.text == "1 ann hits the wall in Haarnadel"
    assert world.state[0, 0]["wall_s"] > 0.0

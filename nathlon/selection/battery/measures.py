"""What a run in a skill test comes to: functions of the RESULTS of one race, by name."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from nathlon.arena.tested import BREAKDOWNS
from nathlon.arena.world import KNOWN, World
from nathlon.selection.battery.scoring import Kind

OWN = "own."
"""Before the name of a measure that a world declares itself."""

Row = Mapping[str, Any]
"""One car's row of RESULTS."""


@dataclass(frozen=True)
class SkillMeasure:
    """A way to measure a run.

    Attributes:
        kind: in a `time` less is better, in a `distance` more, whatever the unit.
        unit: of the mark.
        relative: whether gains are given as shares of the built-in driver's mark, or in `unit`.
        mark: of the entrant's row and those of the others; None where the run set none.
    """

    kind: Kind
    unit: str
    relative: bool
    mark: Callable[[Row, Sequence[Row]], float | None]


def _time(own: Row, _: Sequence[Row]) -> float | None:
    return own["race_time_s"]


def _best_lap(own: Row, _: Sequence[Row]) -> float | None:
    return own["best_lap_s"]


def _lap_loss(own: Row, _: Sequence[Row]) -> float | None:
    """How much the mean lap of those driven lies above the best of them."""
    if own["race_time_s"] is None or own["best_lap_s"] is None:
        return None
    return own["race_time_s"] / own["laps"] - own["best_lap_s"]


def _lead(own: Row, others: Sequence[Row]) -> float | None:
    """An opponent that did not finish counts as finishing when its run ended."""
    if own["race_time_s"] is None or not others:
        return None
    times = (row["driven_s"] if row["race_time_s"] is None else row["race_time_s"] for row in others)
    return min(times) - own["race_time_s"]


def _distance(own: Row, _: Sequence[Row]) -> float | None:
    return own["distance_m"]


def _pace(own: Row, _: Sequence[Row]) -> float | None:
    if own["distance_m"] is None or not own["driven_s"]:
        return None
    took = own["driven_s"] if own["race_time_s"] is None else own["race_time_s"]
    return float(own["distance_m"] / took)


def _stopped(own: Row, _: Sequence[Row]) -> float | None:
    return float(own["ending"] in BREAKDOWNS)


def _place(own: Row, _: Sequence[Row]) -> float | None:
    return float(own["place"])


def _at_fault(own: Row, _: Sequence[Row]) -> float | None:
    return None if own["contacts_at_fault"] is None else float(own["contacts_at_fault"])


def _contacts(own: Row, _: Sequence[Row]) -> float | None:
    return None if own["contacts"] is None else float(own["contacts"])


def _off_course(own: Row, _: Sequence[Row]) -> float | None:
    return own["off_course_s"]


def _score(own: Row, _: Sequence[Row]) -> float | None:
    return own["score"]


def _own(name: str) -> Callable[[Row, Sequence[Row]], float | None]:
    def mark(own: Row, _: Sequence[Row]) -> float | None:
        return own[name] if name in KNOWN else json.loads(own["measures"] or "{}").get(name)

    return mark


MEASURES: dict[str, SkillMeasure] = {
    "time": SkillMeasure("time", "s", True, _time),
    "best_lap": SkillMeasure("time", "s", True, _best_lap),
    "lap_loss": SkillMeasure("time", "s", False, _lap_loss),
    "lead": SkillMeasure("distance", "s", False, _lead),
    "distance": SkillMeasure("distance", "m", True, _distance),
    "pace": SkillMeasure("distance", "m/s", True, _pace),
    "stopped": SkillMeasure("time", "of runs", False, _stopped),
    "place": SkillMeasure("time", "places", False, _place),
    "at_fault": SkillMeasure("time", "contacts", False, _at_fault),
    "contacts": SkillMeasure("time", "contacts", False, _contacts),
    "off_course": SkillMeasure("time", "s", False, _off_course),
    "score": SkillMeasure("distance", "1", False, _score),
}
"""All measures: time to the finish; the best lap; how much the mean lap lies above the best; the lead
over the best opponent at the finish; the way driven until the run ended; the mean speed along the road;
whether the run ended early, stuck or by the policy's fault; the finishing place; contacts that the stewards
lay to the entrant, and all that it had; time off course; the score that another world gives."""


def measured(name: str, world: World) -> SkillMeasure:
    """The measure of a name: one of MEASURES, or `own.NAME` of those that a world declares.

    Raises:
        KeyError: if there is none.
    """
    if not name.startswith(OWN):
        return MEASURES[name]
    if name.removeprefix(OWN) in KNOWN:
        raise KeyError(name)
    declared = world.measures[name.removeprefix(OWN)]
    kind: Kind = "time" if declared.goal == "min" else "distance"
    return SkillMeasure(kind, declared.unit, False, _own(name.removeprefix(OWN)))

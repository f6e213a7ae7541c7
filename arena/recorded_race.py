"""What a race log from a file must be: whatever shows it relies on it."""

from __future__ import annotations

import numpy as np

from nathlon.arena.race_log import CAR_SAMPLE, KINDS, RaceLog

MOST_CARS = 20
LONGEST_S = 1e5
FARTHEST = 1e7
"""m, rad, m/s: no number of a sample or of a circuit is larger."""
NUMBERS = tuple(name for name in CAR_SAMPLE.names or () if CAR_SAMPLE[name].kind == "f")


def check_race(log: RaceLog) -> None:
    """Check that a log can be that of a race.

    Raises:
        ValueError: naming the first field that is not as it should be.
    """
    if not 1 <= len(log.names) <= MOST_CARS:
        raise ValueError(f"field names has {len(log.names)} cars, expected 1 to {MOST_CARS}")
    if not set(log.teams) <= {-1, 0, 1}:
        raise ValueError("field teams names an unknown team, expected -1, 0 or 1")
    for field in ("car_length_m", "car_width_m"):
        if not 0.0 < getattr(log, field) <= 100.0:
            raise ValueError(f"field {field} is {getattr(log, field)}, expected up to 100 m")
    _check_circuit(log)
    _check_samples(log)
    _check_incidents(log)


def _check_circuit(log: RaceLog) -> None:
    outline = log.outline
    if len(outline.centre) < 3:
        raise ValueError(f"field centre has {len(outline.centre)} points, expected at least 3")
    for name, line in vars(outline).items():
        if not (np.abs(line) <= FARTHEST).all():
            raise ValueError(f"field {name} holds a number that no circuit has")
    steps = np.linalg.norm(np.diff(outline.centre[:, :2], axis=0, append=outline.centre[:1, :2]), axis=1)
    if not (steps > 0.0).all():
        raise ValueError("field centre has a point twice in a row")
    for section in log.sections:
        if not (abs(section.start_m) <= FARTHEST and abs(section.end_m) <= FARTHEST):
            raise ValueError("field sections holds a number that no circuit has")


def _check_samples(log: RaceLog) -> None:
    time_s = log.time_s
    if not ((time_s >= 0.0) & (time_s <= LONGEST_S)).all() or (np.diff(time_s) <= 0.0).any():
        raise ValueError("topic /cars: time_s does not rise from sample to sample")
    for name in NUMBERS:
        if not (np.abs(log.samples[name]) <= FARTHEST).all():
            raise ValueError(f"topic /cars: {name} holds a number that no race has")
    place, lap = log.samples["place"], log.samples["lap"]
    if ((place < 1) | (place > len(log.names))).any():
        raise ValueError(f"topic /cars: place is not from 1 to {len(log.names)}")
    if ((lap < -FARTHEST) | (lap > FARTHEST)).any():
        raise ValueError("topic /cars: lap holds a number that no race has")


def _check_incidents(log: RaceLog) -> None:
    for incident in log.incidents:
        if incident.kind not in KINDS:
            raise ValueError(
                f"topic /incidents: kind is {incident.kind!r}, expected one of {', '.join(KINDS)}"
            )
        if not incident.cars or not -1 <= incident.fault < len(log.names):
            raise ValueError("topic /incidents: cars or fault names no car")
        if not 0.0 <= incident.time_s <= LONGEST_S:
            raise ValueError("topic /incidents: time_s is at no time of a race")
        if not (abs(incident.closing_m_s) <= FARTHEST and abs(incident.penalty_s) <= FARTHEST):
            raise ValueError("topic /incidents holds a number that no race has")

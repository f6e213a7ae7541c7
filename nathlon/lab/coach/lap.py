"""A lap of a recorded car, metre by metre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import RaceLog, lap_length, origin, progress
from nathlon.sim.track import load_track

STEP_M = 1.0
"""Between two places of a lap."""
LEAST_MOVE_M = 0.02
"""Between two samples that are kept: a car that stands has no place of its own for each."""
STANDING_M_S = 3.0
"""A race that begins slower begins from a grid."""

Trace = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Lap:
    """From the line to the line; every array is (places,), `STEP_M` apart along the centre line.

    Attributes:
        number: of the lap in its race, from 1.
        standing: whether the car began it, or the way to it, at rest on the grid.
        start_s: when the car crossed the line, s since the start of the race.
        time_s: since then.
        speed: ahead in the car's frame, m/s.
        pedal: throttle (+) or brake (-), from -1 to 1.
        steering: share of full lock, + is left.
        lateral: left of the centre line, m.
        heading: relative to the centre line, rad.
        side_speed: to the left in the car's frame, m/s.
        yaw_rate: rad/s.
        acceleration, side_acceleration: in the car's frame, m/s^2.
        gear: from 1.
        off_course, wall_contact: whether the car was or had any about there.
    """

    number: int
    standing: bool
    start_s: float
    time_s: Trace
    speed: Trace
    pedal: Trace
    steering: Trace
    lateral: Trace
    heading: Trace
    side_speed: Trace
    yaw_rate: Trace
    acceleration: Trace
    side_acceleration: Trace
    gear: NDArray[np.int64]
    off_course: NDArray[np.bool_]
    wall_contact: NDArray[np.bool_]

    @property
    def lap_s(self) -> float:
        """How long it took, s."""
        return float(self.time_s[-1])

    def at(self, place_m: float) -> int:
        """Index of a place, m from the line, or of the nearest that there is."""
        return int(np.clip(round(place_m / STEP_M), 0, len(self.time_s) - 1))

    def between(self, start_m: float, end_m: float) -> float:
        """Time from one place to another, s."""
        return float(self.time_s[self.at(end_m)] - self.time_s[self.at(start_m)])


def laps_of(log: RaceLog, car: int) -> list[Lap]:
    """The laps that a car has completed, first to last; one that it began from the grid with the rest.

    Raises:
        InputError: if the circuit of the race is not known here.
    """
    moved = _Moved(log, car)
    return [moved.lap(number) for number in range(1, moved.laps + 1)]


class _Moved:
    """A car's samples while it moved forward."""

    def __init__(self, log: RaceLog, car: int) -> None:
        self._length = lap_length(log.outline)
        place = origin(log) + progress(log)[:, car] if len(log.time_s) else np.zeros(0)
        # A car that spins moves backwards for a moment.
        furthest = np.maximum.accumulate(place) if len(place) else place
        kept = np.concatenate([[True], np.diff(furthest) > LEAST_MOVE_M]) if len(place) else np.zeros(0, bool)
        self._place, self._samples = furthest[kept], log.samples[kept, car]
        self._time = log.time_s[kept].copy()
        ended = [i.time_s for i in log.incidents if i.kind == "ending" and i.cars == (car,)]
        if len(self._time) > 1 and not self._samples["driving"][-1] and ended:
            # A car that finishes stays where it is until its tick is over.
            self._time[-1] = np.clip(ended[0], np.nextafter(self._time[-2], np.inf), self._time[-1])
        track = load_track(log.circuit)
        _, _, road = track.pose(self._place, np.zeros(len(self._place)))
        turned = self._samples["yaw_rad"] - road
        self._heading = np.unwrap(np.arctan2(np.sin(turned), np.cos(turned)))
        self._places = np.arange(round(self._length / STEP_M) + 1) * (
            self._length / round(self._length / STEP_M)
        )

    @property
    def laps(self) -> int:
        """Completed."""
        # A lap is complete within the metre that a tick may fall short of its line.
        return int((self._place[-1] + 1.0) // self._length) if len(self._place) else 0

    def lap(self, number: int) -> Lap:
        at = self._places + (number - 1) * self._length
        after = np.clip(np.searchsorted(self._place, at), 0, len(self._place) - 1)

        def trace(field: str) -> Trace:
            return np.interp(at, self._place, self._samples[field].astype(np.float64))

        time = np.interp(at, self._place, self._time)
        pedal = self._samples["throttle"].astype(np.float64) - self._samples["brake"]
        return Lap(
            number=number,
            standing=number == 1 and bool(self._samples["velocity_x_m_s"][0] < STANDING_M_S),
            start_s=float(time[0]),
            time_s=time - time[0],
            speed=trace("velocity_x_m_s"),
            pedal=pedal[after],  # a sample tells what was done in the tick before it
            steering=trace("steering"),
            lateral=trace("lateral_m"),
            heading=np.interp(at, self._place, self._heading),
            side_speed=trace("velocity_y_m_s"),
            yaw_rate=trace("yaw_rate_rad_s"),
            acceleration=trace("acceleration_x_m_s2"),
            side_acceleration=trace("acceleration_y_m_s2"),
            gear=self._samples["gear"][after].astype(np.int64),
            off_course=self._samples["off_course"][after].astype(np.bool_),
            wall_contact=self._samples["wall_contact"][after].astype(np.bool_),
        )

"""Watches one race of a match and keeps it as a race log."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from arena.match import Match
from arena.race_log import CAR_SAMPLE, Incident, Outline, RaceLog
from arena.runner import run_match
from policies.policy import Policy
from sim.track import LEFT, RIGHT, WALL_LEFT, WALL_RIGHT, Track
from sim.world import World

COPIED = {
    "x_m": "x",
    "y_m": "y",
    "yaw_rad": "yaw",
    "velocity_x_m_s": "velocity_x",
    "velocity_y_m_s": "velocity_y",
    "yaw_rate_rad_s": "yaw_rate",
    "acceleration_x_m_s2": "acceleration_x",
    "acceleration_y_m_s2": "acceleration_y",
    "throttle": "throttle",
    "brake": "brake",
    "gear": "gear",
    "lateral_m": "lateral",
    "lap": "laps",
    "off_course": "off_course",
    "wall_contact": "wall_contact",
    "car_contact": "car_contact",
    "slipstream": "draught",
    "driving": "driving",
}
"""Fields of CAR_SAMPLE that are fields of CAR_STATE."""


def record_race(match: Match, policies: Sequence[Policy], race: int, names: Sequence[str]) -> RaceLog:
    """Run a match again and keep one of its races.

    Args:
        match: the match.
        policies: one for each of its entrants.
        race: index of the race.
        names: of the match's entrants, as reports show them.
    """
    recorder = _Recorder(race, [names[seat.entrant] for seat in match.races[race].seats])
    results = run_match(match, policies, recorder)
    rows = results.filter(results["race"] == race).sort("car")
    return recorder.log(match, dict(enumerate(rows["ending"])), rows["driven_s"].to_numpy())


class _Recorder:
    def __init__(self, race: int, names: Sequence[str]) -> None:
        self._race, self._names = race, names
        self._time: list[float] = []
        self._samples: list[NDArray[np.void]] = []
        self._incidents: list[Incident] = []
        self._world: World | None = None

    def __call__(self, world: World) -> None:
        self._world = world
        cars = world.state[self._race]
        if self._samples and not self._samples[-1]["driving"].any():
            return
        sample = np.zeros(len(cars), CAR_SAMPLE)
        for name, source in COPIED.items():
            sample[name] = cars[source]
        sample["gear"] += 1
        sample["steering"] = cars["steering"] / world.parameters.full_lock
        sample["distance_m"] = cars["progress"] - cars["start"]
        ahead = np.where(np.isnan(cars["finish_s"]), cars["progress"], 1e9 - np.nan_to_num(cars["finish_s"]))
        sample["place"][np.argsort(-ahead, kind="stable")] = np.arange(1, len(cars) + 1)
        if self._samples:
            self._note(world, sample, self._samples[-1])
        self._time.append(float(world.time[self._race]))
        self._samples.append(sample)

    def _note(self, world: World, now: NDArray[np.void], before: NDArray[np.void]) -> None:
        time = float(world.time[self._race])
        names = [f"{car} {name}" for car, name in enumerate(self._names)]
        impact, blame = world.impact[self._race], world.blame[self._race]
        where = [_section(world.track, progress) for progress in world.state[self._race]["progress"]]
        for i, j in np.argwhere(np.triu(impact >= 0.0, 1)):
            first, second = (i, j) if not blame[j, i] else (j, i)
            how = "runs into" if blame[first, second] else "touches"
            text = f"{names[first]} {how} {names[second]} at {impact[i, j]:.1f} m/s, {where[first]}"
            self._incidents.append(Incident(time, "contact", (int(first), int(second)), text))
        for flag, verb in (("wall_contact", "hits the wall"), ("off_course", "leaves the course")):
            for car in np.flatnonzero(now[flag] & ~before[flag]):
                kind = flag.removesuffix("_contact")
                self._incidents.append(
                    Incident(time, kind, (int(car),), f"{names[car]} {verb}, {where[car]}")
                )

    def log(self, match: Match, endings: dict[int, str], driven: NDArray[np.float64]) -> RaceLog:
        """All that was seen, as a race log."""
        assert self._world is not None
        race, body = match.races[self._race], self._world.car.body
        incidents = list(self._incidents)
        for car, ending in endings.items():
            text = f"{car} {self._names[car]}: {ending.replace('_', ' ')} after {driven[car]:.3f} s"
            incidents.append(Incident(float(driven[car]), "ending", (car,), text))
        return RaceLog(
            circuit=match.circuit,
            car=match.car,
            scenario=match.scenario,
            seed=race.seed,
            match=match.key,
            race=self._race,
            version=version("nathlon"),
            names=tuple(self._names),
            teams=tuple(seat.team for seat in race.seats),
            car_length_m=body.length_m,
            car_width_m=body.width_m,
            outline=outline(self._world.track),
            time_s=np.array(self._time),
            samples=np.stack(self._samples),
            incidents=tuple(sorted(incidents, key=lambda incident: incident.time_s)),
        )


def outline(track: Track) -> Outline:
    """The circuit's lines for drawing."""
    table = track.table
    return Outline(
        left=track.offset_line(table[:, LEFT]),
        centre=track.offset_line(0.0),
        right=track.offset_line(-table[:, RIGHT]),
        wall_left=track.offset_line(table[:, WALL_LEFT]),
        wall_right=track.offset_line(-table[:, WALL_RIGHT]),
    )


def _section(track: Track, progress: float) -> str:
    at = progress % track.length
    for corner in track.corners:
        if corner.start_m <= at <= corner.end_m:
            return f"{corner.name} ({at:.0f} m)"
    return f"{at:.0f} m"

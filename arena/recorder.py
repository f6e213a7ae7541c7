"""Watches one race of a match and keeps it as a race log."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from typing import NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from arena.incidents import IncidentWatch
from arena.match import Match
from arena.race_log import CAR_SAMPLE, Incident, Outline, RaceLog, Stretch
from arena.runner import run_together
from arena.team import Absent
from arena.watch import Watch
from policies.policy import Policy
from sim.car import load_car
from sim.rules import load_rules
from sim.scenario import load_scenario
from sim.track import (
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    WALL_LEFT,
    WALL_RIGHT,
    ZONE,
    Track,
    load_track,
)
from sim.world import SUBSTEPS, World

COPIED = {
    "x_m": "x",
    "y_m": "y",
    "z_m": "z",
    "yaw_rad": "yaw",
    "velocity_x_m_s": "velocity_x",
    "velocity_y_m_s": "velocity_y",
    "yaw_rate_rad_s": "yaw_rate",
    "acceleration_x_m_s2": "acceleration_x",
    "acceleration_y_m_s2": "acceleration_y",
    "throttle": "throttle",
    "brake": "brake",
    "lateral_m": "lateral",
    "lap": "laps",
    "penalty_s": "penalty_s",
    "slipstream": "draught",
    "driving": "driving",
}
"""Fields of CAR_SAMPLE that are fields of CAR_STATE."""
FLAGS = ("off_course", "wall_contact", "car_contact")
"""Fields of both that tell of the time since the last sample or step."""


class Recorded(NamedTuple):
    """A match that was run to be looked at.

    Attributes:
        results: schema RESULTS.
        logs: of the races that were kept.
    """

    results: pl.DataFrame
    logs: list[RaceLog]


def record_races(
    match: Match,
    policies: Sequence[Policy | Absent],
    races: Sequence[int],
    names: Sequence[str],
    watch: Watch | None = None,
) -> Recorded:
    """Run a match again and keep some of its races, at its own rate of actions or 10 to 20 samples a second.

    Args:
        match: the match.
        policies: one for each of its entrants.
        races: indices of the races to keep; the logs are in their order.
        names: of the match's entrants, as reports show them.
        watch: told who is asked.
    """
    recorders = [
        _Recorder(match, race, [names[seat.entrant] for seat in match.races[race].seats]) for race in races
    ]

    def observe(world: World) -> None:
        for recorder in recorders:
            recorder(world)

    [(_, results)] = run_together({0: (match, policies)}, watch or Watch(), observe)
    logs = []
    for race, recorder in zip(races, recorders, strict=True):
        rows = results.filter(results["race"] == race).sort("car")
        logs.append(recorder.log(list(rows["ending"]), rows["driven_s"].to_list()))
    return Recorded(results, logs)


class _Recorder:
    def __init__(self, match: Match, race: int, names: Sequence[str]) -> None:
        self._match, self._race, self._names = match, race, names
        self._track = load_track(match.circuit)
        rules = load_rules(load_scenario(match.scenario).rules)
        self._watch = IncidentWatch(race, names, rules, self._track)
        self._time: list[float] = []
        self._samples: list[NDArray[np.void]] = []
        self._ticks, self._sampled = 0, -2 * SUBSTEPS
        self._raised = {flag: np.zeros(len(names), bool) for flag in FLAGS}

    def __call__(self, world: World) -> None:
        if self._samples and not self._samples[-1]["driving"].any():
            return
        cars, ticks = world.state[self._race], int(world.ticks[self._race])
        self._watch.see(world)
        for flag in FLAGS:
            self._raised[flag] |= cars[flag]
        step, self._ticks = ticks - self._ticks, ticks
        # The world may step faster than is worth keeping.
        if ticks + step - self._sampled > SUBSTEPS or not cars["driving"].any():
            self._sampled = ticks
            self._time.append(float(world.time[self._race]))
            self._samples.append(self._sample(cars, world.parameters.full_lock))

    def _sample(self, cars: NDArray[np.void], full_lock: float) -> NDArray[np.void]:
        sample = np.zeros(len(cars), CAR_SAMPLE)
        for name, source in COPIED.items():
            sample[name] = cars[source]
        for flag in FLAGS:
            sample[flag] = self._raised[flag]
            self._raised[flag][:] = False
        pitch = -np.arctan(cars["slope_x"])
        sample["pitch_rad"] = pitch
        sample["roll_rad"] = np.arctan(cars["slope_y"] * np.cos(pitch))
        sample["gear"] = cars["gear"] + 1
        sample["steering"] = cars["steering"] / full_lock
        sample["distance_m"] = cars["progress"] - cars["start"]
        ahead = np.where(np.isnan(cars["finish_s"]), cars["progress"], 1e9 - np.nan_to_num(cars["finish_s"]))
        sample["place"][np.argsort(-ahead, kind="stable")] = np.arange(1, len(cars) + 1)
        return sample

    def log(self, endings: Sequence[str], driven_s: Sequence[float]) -> RaceLog:
        """All that was seen, as a race log, with each car's ending and the time until then."""
        match, race, body = self._match, self._match.races[self._race], load_car(self._match.car).body
        incidents = list(self._watch.incidents)
        for car, (ending, seconds) in enumerate(zip(endings, driven_s, strict=True)):
            text = f"{car} {self._names[car]}: {ending.replace('_', ' ')} after {seconds:.3f} s"
            added_s = float(self._samples[-1]["penalty_s"][car]) if ending == "finished" else 0.0
            if added_s > 0.0:
                text += f", {added_s:.3f} s of it for penalties"
            incidents.append(Incident(seconds - added_s, "ending", (car,), text))
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
            outline=outline(self._track),
            sections=tuple(
                Stretch(section.name, section.kind, section.start_m, section.end_m)
                for section in self._track.sections
            ),
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
        kerb_left=track.offset_line(table[:, LEFT] + table[:, KERB_LEFT]),
        kerb_right=track.offset_line(-table[:, RIGHT] - table[:, KERB_RIGHT]),
        wall_left=track.offset_line(table[:, WALL_LEFT]),
        wall_right=track.offset_line(-table[:, WALL_RIGHT]),
        runoff_left=table[:, RUNOFF_LEFT].astype(np.int64),
        runoff_right=table[:, RUNOFF_RIGHT].astype(np.int64),
        zone=table[:, ZONE] > 0.0,
    )

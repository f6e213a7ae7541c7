"""Watches races of a match and keeps them as race logs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from importlib.metadata import version
from typing import NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.incidents import Alarm, IncidentWatch
from nathlon.arena.match import BACKGROUND, NO_TEAM, Match
from nathlon.arena.race_log import (
    CAR_SAMPLE,
    RESOLUTION,
    Incident,
    NamedStretch,
    Outline,
    RaceLog,
    start_number,
)
from nathlon.arena.runner import Observer, run_together
from nathlon.arena.sight import Seen, Sight
from nathlon.arena.team import Absent
from nathlon.arena.watch import Watch
from nathlon.policies.policy import Policy
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.car import load_car
from nathlon.sim.clock import SUBSTEPS
from nathlon.sim.rules import load_rules
from nathlon.sim.scenario import load_scenario
from nathlon.sim.state import CAR_STATE
from nathlon.sim.track import (
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
from nathlon.sim.world import World

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
SEEN = np.dtype(
    [
        (name, CAR_STATE[name])
        for name in sorted(
            {*COPIED.values(), "slope_x", "slope_y", "gear", "steering", "progress", "start", "finish_s"}
        )
    ]
)
"""Those fields of CAR_STATE that samples are made of."""


class Recorded(NamedTuple):
    """A match that was run to be looked at.

    Attributes:
        results: schema RESULTS.
        logs: of the races that were kept.
        seen: by the drivers of the car that was asked for, in turn.
        processor: kind of processor that ran it, if it was not this machine; see `nathlon.arena.processor`.
    """

    results: pl.DataFrame
    logs: list[RaceLog]
    seen: tuple[Seen, ...] = ()
    processor: str | None = None


class _Moment(NamedTuple):
    """What some races looked like at a time.

    Attributes:
        kept: (races,) bool, whose sample this is.
        time_s: (races,) float64.
        cars: (races, cars) SEEN.
        raised: (races, cars) bool, by the names in FLAGS.
    """

    kept: NDArray[np.bool_]
    time_s: NDArray[np.float64]
    cars: NDArray[np.void]
    raised: dict[str, NDArray[np.bool_]]


def record_races(
    match: Match,
    policies: Sequence[Policy | Absent],
    races: Sequence[int],
    names: Sequence[str],
    watch: Watch | None = None,
    seen_by: int | None = None,
    observer: Observer | None = None,
) -> Recorded:
    """Run a match again and keep some of its races, at its own rate of actions or 10 to 20 samples a second.

    Args:
        match: the match.
        policies: one for each of its entrants.
        races: indices of the races to keep; the logs are in their order.
        names: of the match's entrants, as reports show them.
        watch: told who is asked.
        seen_by: a car of the first of these races; what its drivers see is kept.
        observer: as for `run_match`.
    """
    recorder = _Recorder(match, races, names, [camera_of(policy) for policy in policies])
    sight = None if seen_by is None else Sight(match, policies, races[0], seen_by)

    def observe(world: World) -> None:
        recorder(world)
        if sight:
            sight(world)
        if observer:
            observer(world)

    [(_, results)] = run_together({0: (match, policies)}, watch or Watch(), observe)
    logs = []
    for index, race in enumerate(races):
        rows = results.filter(results["race"] == race).sort("car")
        logs.append(recorder.log(index, list(rows["ending"]), rows["driven_s"].to_list()))
    return Recorded(results, logs, sight.seen if sight else ())


class _Recorder:
    """Watches some races of a match; arrays begin with an axis of these races."""

    def __init__(
        self,
        match: Match,
        races: Sequence[int],
        names: Sequence[str],
        cameras: Sequence[CameraSpec | None],
    ) -> None:
        self._match, self._races, self._cameras = match, list(races), cameras
        self._names = [_driver_names(match, race, names) for race in races]
        self._track = load_track(match.circuit)
        self._outline = outline(self._track)
        rules = load_rules(load_scenario(match.scenario).rules)
        self._watches = [
            IncidentWatch(race, cars, rules, self._track)
            for race, cars in zip(races, self._names, strict=True)
        ]
        self._alarm = Alarm(self._races)
        self._moments: list[_Moment] = []
        self._ticks = np.zeros(len(races), np.int64)
        self._sampled = np.full(len(races), -2 * SUBSTEPS)
        self._over = np.zeros(len(races), bool)
        self._raised: dict[str, NDArray[np.bool_]] = {}
        self._full_lock = 1.0

    def __call__(self, world: World) -> None:
        if self._over.all():
            return
        for index in np.flatnonzero(self._alarm(world) & ~self._over):
            self._watches[index].see(world)
        state, ticks = world.state, world.ticks[self._races]
        raised = {flag: state[flag][self._races] for flag in FLAGS}
        for flag, before in self._raised.items():
            raised[flag] |= before
        step, self._ticks = ticks - self._ticks, ticks
        ended = ~state["driving"][self._races].any(axis=1)
        # The world may step faster than is worth keeping.
        kept = ((ticks + step - self._sampled > SUBSTEPS) | ended) & ~self._over
        self._over |= ended
        if kept.any():
            self._sampled[kept] = ticks[kept]
            cars = state[list(SEEN.names or ())].astype(SEEN)[self._races]
            self._moments.append(_Moment(kept, world.time[self._races], cars, raised))
        self._full_lock = world.parameters.car.full_lock
        self._raised = {flag: since & ~kept[:, None] for flag, since in raised.items()}

    @cached_property
    def _seen(self) -> tuple[NDArray[np.void], dict[str, NDArray[np.bool_]]]:
        """(moments, races, cars) SEEN, and by the names in FLAGS what was raised."""
        # np.stack would compare the records' types once a moment.
        cars = np.empty((len(self._moments), *self._moments[0].cars.shape), SEEN)
        for row, moment in enumerate(self._moments):
            cars[row] = moment.cars
        return cars, {flag: np.array([moment.raised[flag] for moment in self._moments]) for flag in FLAGS}

    def _samples(self, index: int, kept: NDArray[np.bool_]) -> NDArray[np.void]:
        """(moments, cars) CAR_SAMPLE of one of the races at some of its moments."""
        seen, raised = self._seen
        cars = seen[kept, index]
        sample = np.zeros(cars.shape, CAR_SAMPLE)
        for name, source in COPIED.items():
            sample[name] = cars[source]
        for flag in FLAGS:
            sample[flag] = raised[flag][kept, index]
        pitch = -np.arctan(cars["slope_x"])
        sample["pitch_rad"] = pitch
        sample["roll_rad"] = np.arctan(cars["slope_y"] * np.cos(pitch))
        sample["gear"] = cars["gear"] + 1
        sample["steering"] = cars["steering"] / self._full_lock
        sample["distance_m"] = cars["progress"] - cars["start"]
        ahead = np.where(np.isnan(cars["finish_s"]), cars["progress"], 1e9 - np.nan_to_num(cars["finish_s"]))
        order = np.argsort(-ahead, axis=1, kind="stable")
        np.put_along_axis(sample["place"], order, np.arange(1, cars.shape[1] + 1), axis=1)
        for name, step in RESOLUTION.items():
            sample[name] = np.round(sample[name] / step) * step
        return sample

    def log(self, index: int, endings: Sequence[str], driven_s: Sequence[float]) -> RaceLog:
        """All that was seen, as a race log, with each car's ending and the time until then."""
        match, number = self._match, self._races[index]
        race, names, body = match.races[number], self._names[index], load_car(match.car).body
        kept = np.array([moment.kept[index] for moment in self._moments])
        samples = self._samples(index, kept)
        incidents = list(self._watches[index].incidents)
        for car, (ending, seconds) in enumerate(zip(endings, driven_s, strict=True)):
            text = f"{start_number(car)} {names[car]}: {ending.replace('_', ' ')} after {seconds:.3f} s"
            added_s = float(samples["penalty_s"][-1, car]) if ending == "finished" else 0.0
            if added_s > 0.0:
                text += f", {added_s:.3f} s of it for penalties"
            incidents.append(Incident(seconds - added_s, "ending", (car,), text))
        return RaceLog(
            circuit=match.circuit,
            car=match.car,
            scenario=match.scenario,
            seed=race.seed,
            match=match.key,
            race=number,
            version=version("nathlon"),
            names=tuple(names),
            teams=tuple(NO_TEAM if seat.team == BACKGROUND else seat.team for seat in race.seats),
            car_length_m=body.length_m,
            car_width_m=body.width_m,
            outline=self._outline,
            sections=stretches(self._track),
            time_s=np.array([moment.time_s[index] for moment in self._moments])[kept],
            samples=samples,
            incidents=tuple(sorted(incidents, key=lambda incident: incident.time_s)),
            cameras=tuple(self._cameras[seat.entrant] for seat in race.seats) if any(self._cameras) else (),
        )


def camera_of(policy: Policy | Absent) -> CameraSpec | None:
    """By which a policy sees, if by any."""
    return None if isinstance(policy, Absent) else policy.observation_spec.camera


def _driver_names(match: Match, race: int, names: Sequence[str]) -> list[str]:
    """Names of those who drive the cars of a race; one who takes over later is named with the moment."""
    drivers = [names[seat.entrant] for seat in match.races[race].seats]
    if match.swap and match.swap.race == race:
        name, from_s = names[match.swap.entrant], match.swap.from_s
        drivers[match.swap.car] = f"{name} from {from_s:g} s" if from_s > 0.0 else name
    return drivers


def stretches(track: Track) -> tuple[NamedStretch, ...]:
    """The sections of a circuit."""
    return tuple(
        NamedStretch(section.name, section.kind, section.start_m, section.end_m) for section in track.sections
    )


@lru_cache(maxsize=2)
def outline(track: Track) -> Outline:
    """The circuit's lines for drawing, to a millimetre; kept, as what is drawn from them is."""
    table = track.table

    def line(lateral_m: NDArray[np.float64] | float) -> NDArray[np.float64]:
        step = RESOLUTION["x_m"]
        return np.asarray(np.round(track.offset_line(lateral_m) / step) * step)

    return Outline(
        left=line(table[:, LEFT]),
        centre=line(0.0),
        right=line(-table[:, RIGHT]),
        kerb_left=line(table[:, LEFT] + table[:, KERB_LEFT]),
        kerb_right=line(-table[:, RIGHT] - table[:, KERB_RIGHT]),
        wall_left=line(table[:, WALL_LEFT]),
        wall_right=line(-table[:, WALL_RIGHT]),
        runoff_left=table[:, RUNOFF_LEFT].astype(np.int64),
        runoff_right=table[:, RUNOFF_RIGHT].astype(np.int64),
        zone=table[:, ZONE] > 0.0,
        lane=_lane(track),
    )


def _lane(track: Track) -> NDArray[np.int64]:
    """On which side of each row the pit lane lies; see `Outline`."""
    lane = track.pit_lane
    from_entry_m = (np.arange(len(track.table)) * track.spacing - lane.entry_m) % track.length
    side = 1 if lane.side == "left" else -1
    return np.where(from_entry_m < lane.length(track.length), side, 0)

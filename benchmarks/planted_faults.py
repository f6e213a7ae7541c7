"""Drivers with one known fault each: the built-in driver, spoilt everywhere or in some parts of the lap."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recorder import record_races
from nathlon.arena.watch import Watch
from nathlon.lab.coach.lap import Lap
from nathlon.lab.coach.parts import CoursePart, marks
from nathlon.policies.driver import Driver, Follower
from nathlon.policies.driver.early_braker import EarlyBraker
from nathlon.policies.driver.envelope import envelope
from nathlon.policies.driver.speed_profile import profile
from nathlon.policies.policy import Batch, Policy
from nathlon.results.coach import CauseKind
from nathlon.results.words import percent
from nathlon.sim.car import load_car
from nathlon.sim.track import load_track

PACE = 0.96
"""Of the driver without a fault: nearer the limit it would leave the road by most of them."""
BRAKES = -0.3
"""Pedal of a bend that one brakes for."""
RUN_UP_M, RUN_OUT_M = 80.0, 20.0
"""Before a bend and after its slowest place, where the driver brakes wrongly."""

Place = Literal["everywhere", "bends", "brakings", "exits", "straights"]
Made = Callable[[str, str], Policy]
"""A driver for a circuit and a car."""


@dataclass(frozen=True)
class Fault:
    """A known fault.

    Attributes:
        name: of the fault.
        place: in which parts of the lap it is planted, and looked for.
        made: a driver that has it everywhere.
        kinds: what a coach may call it.
    """

    name: str
    place: Place
    made: Made
    kinds: tuple[CauseKind, ...]


class Spoilt:
    """A driver whose pedals are spoilt.

    Args:
        circuit, car: names.
        pedals: what becomes of those here (n,) and of those that it would have some metres before.
        behind_m: how many, m.
    """

    def __init__(
        self, circuit: str, car: str, pedals: Callable[[Batch, Batch], Batch], behind_m: float = 0.0
    ) -> None:
        self._driver, self._pedals = Driver(circuit, car, PACE), pedals
        self.observation_spec = self._driver.observation_spec
        self._turn = 2.0 * np.pi * behind_m / load_track(circuit).length
        self._progress = self.observation_spec.slice("progress")

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`."""
        return self._driver.initial_memory(n)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """See `Policy.act`."""
        before = observations.copy()
        sine, cosine = observations[:, self._progress].T
        before[:, self._progress.start] = sine * np.cos(self._turn) - cosine * np.sin(self._turn)
        before[:, self._progress.start + 1] = cosine * np.cos(self._turn) + sine * np.sin(self._turn)
        earlier = self._driver.act(before, memory)[0][:, 0]
        actions, memory = self._driver.act(observations, memory)
        actions[:, 0] = self._pedals(actions[:, 0], earlier)
        return actions, memory


class Within:
    """A driver that has a fault in some parts of the lap.

    Args:
        circuit, car: names.
        faulty: drives there.
        spans: (parts, 2) from where to where, m from the line.
    """

    def __init__(self, circuit: str, car: str, faulty: Policy, spans: NDArray[np.float64]) -> None:
        self._driver, self._faulty, self._spans = Driver(circuit, car, PACE), faulty, spans
        self.observation_spec = self._driver.observation_spec
        self._length_m, self._progress = load_track(circuit).length, self.observation_spec.slice("progress")

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`."""
        return self._driver.initial_memory(n)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """See `Policy.act`."""
        sine, cosine = observations[:, self._progress].T
        at_m = (np.arctan2(sine, cosine) / (2.0 * np.pi) % 1.0) * self._length_m
        spoilt = ((at_m[:, None] >= self._spans[:, 0]) & (at_m[:, None] < self._spans[:, 1])).any(axis=1)
        answers = zip(
            self._driver.act(observations, memory), self._faulty.act(observations, memory), strict=True
        )
        actions, remembered = (np.where(spoilt[:, None], wrong, right) for right, wrong in answers)
        return actions, remembered


def _line(circuit: str, car: str, width: float = 1.0, grip: float = 1.0) -> Policy:
    """A line that uses a share of the road, or a grip that is trusted less, at the speeds that follow."""
    track, model, line = load_track(circuit), load_car(car), Driver(circuit, car).line
    moved = profile(track, width * line.offset, envelope(model), grip * line.grip)
    return Follower(track, model, PACE, moved)


def _throttle_late(here: Batch, before: Batch) -> Batch:
    return np.where(here > 0.0, np.minimum(here, np.maximum(before, 0.0)), here)


def _faults() -> list[Fault]:
    def early(metres: float) -> Made:
        return lambda circuit, car: EarlyBraker(Driver(circuit, car, PACE), circuit, metres)

    def pedals(spoil: Callable[[Batch, Batch], Batch], behind_m: float = 0.0) -> Made:
        return lambda circuit, car: Spoilt(circuit, car, spoil, behind_m)

    def most(share: float) -> Made:
        return pedals(lambda here, _: np.minimum(here, np.float32(share)))

    def brakes(share: float) -> Made:
        return pedals(lambda here, _: np.where(here < 0.0, here * np.float32(share), here))

    def slower(share: float) -> Made:
        return lambda circuit, car: Driver(circuit, car, share * PACE)

    def line(width: float = 1.0, grip: float = 1.0) -> Made:
        return lambda circuit, car: _line(circuit, car, width, grip)

    return [
        *(
            Fault(
                f"pace {share}",
                "everywhere",
                slower(share),
                ("minimum_speed", "speed", "exit_speed", "lifting"),
            )
            for share in (0.95, 0.9)
        ),
        *(
            Fault(f"grip trusted {percent(share)}", "bends", line(grip=share), ("minimum_speed",))
            for share in (0.9, 0.8)
        ),
        *(Fault(f"braking {m} m early", "brakings", early(m), ("braking_early",)) for m in (15, 30)),
        *(
            Fault(f"braking {m} m late", "brakings", pedals(np.maximum, m), ("braking_late", "entry_speed"))
            for m in (8, 12)
        ),
        *(
            Fault(f"brakes at {percent(share)}", "brakings", brakes(share), ("entry_speed", "braking_late"))
            for share in (0.85, 0.75)
        ),
        *(
            Fault(f"full throttle {m} m late", "exits", pedals(_throttle_late, m), ("throttle",))
            for m in (20, 35)
        ),
        *(
            Fault(f"throttle at most {percent(share)}", "straights", most(share), ("lifting",))
            for share in (0.8, 0.9)
        ),
        *(Fault(f"{percent(width)} of the road", "bends", line(width), ("line",)) for width in (0.6, 0.3)),
    ]


FAULTS = _faults()


def planted(
    fault: Fault, circuit: str, car: str, parts: Sequence[CoursePart], clean: Lap
) -> tuple[Policy, list[CoursePart]]:
    """A driver with a fault, and the parts that have it.

    Args:
        fault: which.
        circuit, car: names.
        parts: of the lap.
        clean: the lap without it.
    """
    faulty = fault.made(circuit, car)
    spans, found = [], []
    for before, part in zip([parts[-1], *parts], parts, strict=False):
        span = _span(fault.place, part, clean)
        # What is slow on a straight after a straight is the fault of that one.
        if span is not None and (part.bend or before.bend or fault.place == "everywhere"):
            spans.append(span)
            found.append(part)
    if fault.place in ("everywhere", "bends"):
        return faulty, found
    return Within(circuit, car, faulty, np.array(spans)), found


def _span(place: Place, part: CoursePart, clean: Lap) -> tuple[float, float] | None:
    """From where to where in a part a fault of a place is planted; None if it has none."""
    if place == "everywhere":
        return part.start_m, part.end_m
    if not part.bend:
        return (part.start_m, part.end_m) if place == "straights" else None
    does = marks(clean, part.start_m, part)
    inside = part.start_m + RUN_OUT_M < does.apex_m < part.end_m - RUN_OUT_M
    hard = clean.pedal[clean.at(part.start_m) : clean.at(does.apex_m) + 1].min() < BRAKES
    match place:
        case "bends":
            return (part.start_m, part.end_m) if inside else None
        case "brakings":
            span = max(part.start_m - RUN_UP_M, 0.0), does.apex_m + RUN_OUT_M
            return span if inside and hard and does.brake_m is not None else None
        case "exits":
            return (does.apex_m, part.end_m) if inside and does.full_m is not None else None
    return None


def driven(policy: Policy, circuit: str, car: str) -> RaceLog:
    """A time trial, recorded."""
    name = "time_trial"
    match = Match("race", name, name, circuit, car, ("driver",), ("driver",), (Race(1, (Seat(0),)),))
    return record_races(match, [policy], (0,), ("driver",), Watch()).logs[0]

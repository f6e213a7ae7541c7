"""Composites: a TOML file that says which policy drives on which part of the race."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from nathlon.policies.policy import Batch, Policy, has_reverse, takes_pace
from nathlon.policies.sources import COMPOSITE, DRIVER, MPPI, PLUGIN, ROLES
from nathlon.policies.sources.strategist import OwnStrategist, load_strategist, strategist_id
from nathlon.policies.stint_model import StintModel
from nathlon.policies.stint_planner import StintPlanner
from nathlon.policies.strategy import Stint, StintPlan, Strategist
from nathlon.sim.data_file import Name, Section, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.observation import VERSION, ObservationSpec
from nathlon.sim.track import Track, load_track

NO_FILES = (DRIVER, PLUGIN)
"""What the names of policies that are no files begin with."""
STRATEGIES = ("stint", "planner", "strategist")
"""Fields of which one at most says what a composite's strategy is."""
PLACE = 2
"""Numbers of the memory that tell where a car started and how far it has come."""

Ask = Callable[[Policy, Batch, Batch], tuple[Batch, Batch]]
"""Gives what a policy does, which sees something and remembers something; see `Policy.act`."""
Load = Callable[[str, str, str], Policy]
"""Gives the policy of a name, circuit and car."""


class CompositePart(Section):
    """A policy and where it drives; a condition that is left out always holds.

    Attributes:
        policy: path of a file of weights, relative to the composite's, or the name of a driver or plugin.
        until_m: drives until the car has come this far from its start, m along the centre line.
        sections: drives in these sections of the circuit; as for `Track.stretch`.
        circuit: drives on this circuit.
    """

    policy: Annotated[str, Field(min_length=1, max_length=1024, pattern=r"^[^\x00]+$")]
    until_m: Annotated[float, Field(ge=0)] | None = None
    sections: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    circuit: str | None = None

    @property
    def unconditional(self) -> bool:
        """Whether it drives wherever it is asked, on its circuit."""
        return self.until_m is None and self.sections is None


class CompositeFile(Section):
    """The composite's TOML file: of the parts whose conditions hold, the first drives.

    Attributes:
        stint: its strategy: what it drives on which tyres, and where it stops.
        strategy: what its strategy is called where policies are raced with several; as it stops if not given.
        planner: its strategy instead: a stint model, by which every lap it plans where to stop.
        strategist: its strategy instead: the user's own code, `PATH.py:NAME` from the file's folder. Without
            any of these it never stops.
    """

    name: Name
    part: Annotated[tuple[CompositePart, ...], Field(min_length=1)]
    strategy: Name | None = None
    stint: tuple[Stint, ...] = ()
    planner: StintModel | None = None
    strategist: Annotated[str, Field(max_length=1024, pattern=r"^[^\x00]+\.py:[^\W\d]\w*$")] | None = None

    @model_validator(mode="after")
    def _one_strategy(self) -> CompositeFile:
        given = [name for name in STRATEGIES if getattr(self, name)]
        if len(given) > 1:
            raise ValueError(f"{given[0]} and {given[1]} are two strategies, expected one of them")
        return self

    @property
    def strategy_label(self) -> str:
        """What its strategy is called."""
        stops = max(len(self.stint) - 1, 0)
        usual = "planner" if self.planner else f"{stops} stop{'s' if stops != 1 else ''}"
        own = self.strategist.rpartition(":")[2] if self.strategist else ""
        return self.strategy or own or usual


@dataclass(frozen=True)
class CompositeSource:
    """A composite as its file describes it, without its policies."""

    path: Path
    file: CompositeFile

    @classmethod
    def read(cls, path: Path) -> CompositeSource:
        """Read a composite's file.

        Raises:
            InputError: if it is none, or a part is a composite or a planner.
        """
        if path.name.endswith(ROLES):
            raise InputError(f"{path}: names policies by role, expected one policy: a race has no roles")
        file = read_toml(path, CompositeFile, "composite")
        for part in file.part:
            if part.policy.endswith(COMPOSITE) or part.policy.startswith(f"{MPPI}:"):
                raise InputError(
                    f"{path}: policy is {part.policy!r}, expected a file of weights, a driver or a plugin"
                )
        return cls(path, file)

    @property
    def sources(self) -> list[str]:
        """The names of all its policies, files by their paths."""
        return [self.source(part) for part in self.file.part]

    def source(self, part: CompositePart) -> str:
        """The name of a part's policy."""
        if part.policy.partition(":")[0] in NO_FILES:
            return part.policy
        return str(self.path.parent / part.policy)

    def identity(self, ids: Sequence[str]) -> str:
        """SHA-256 in hexadecimal of all that decides how it drives, given the ids of all its policies."""
        facts = [part.model_dump_json(exclude={"policy"}) for part in self.file.part]
        facts += [_told(stint) for stint in self.file.stint]
        facts += [self.file.planner.model_dump_json()] if self.file.planner else []
        own = self.file.strategist
        facts += [strategist_id(own, self.path.parent)] if own else []
        return hashlib.sha256("\n".join([*facts, *ids]).encode()).hexdigest()

    def load(self, circuit: str, car: str, load: Load) -> Composite:
        """The policy, made for a circuit and car.

        Raises:
            InputError: if a part's policy cannot be read or its section is not on the circuit, if nobody
                drives at some place, if the parts do not see the same, or if one that takes no pace is to be
                told one.
        """
        parts = [part for part in self.file.part if part.circuit in (None, circuit)]
        if not parts or not parts[-1].unconditional:
            raise InputError(
                f"{self.path}: part: nobody drives everywhere on {circuit}, "
                "expected a last part without until_m and sections"
            )
        track = load_track(circuit)
        sources = [self.source(part) for part in parts]
        policies = [load(source, circuit, car) for source in sources]
        spec = joint_spec(sources, [policy.observation_spec for policy in policies])
        strategist = self._strategist(circuit, car)
        unpaced = [name for name, policy in zip(sources, policies, strict=True) if not takes_pace(policy)]
        if unpaced and self._tells_pace(strategist):
            raise InputError(
                f"{self.path}: pace: {unpaced[0]} takes none, "
                "expected the built-in driver or a policy that sees its plan"
            )
        try:
            return Composite(track, parts, policies, spec, strategist)
        except InputError as error:
            raise InputError(f"{self.path}: sections: {error}") from None

    def _tells_pace(self, strategist: Strategist | None) -> bool:
        own = isinstance(strategist, OwnStrategist) and strategist.tells_pace
        return own or any(stint.pace != 1.0 for stint in self.file.stint)

    def _strategist(self, circuit: str, car: str) -> Strategist | None:
        """Who decides when its cars stop; None if they never do."""
        if self.file.strategist:
            return load_strategist(self.file.strategist, self.path.parent, circuit, car)
        if self.file.planner:
            return StintPlanner(self.file.planner)
        return StintPlan(self.file.stint) if self.file.stint else None


class Composite:
    """A policy made of others; every part watches the whole race, and one of them drives.

    Each part is asked at every tick about every car, so that it knows what it must remember when its
    turn comes, and what it answers does not depend on whose turn it is.

    Its memory is where the car started and the furthest it has come since, both in rad of the lap
    angle, then the memories of its parts.

    Attributes:
        strategist: who decides when its cars stop; None if they never do.
        reverse: whether its cars have a reverse gear: if those of all its policies do.
        paced: whether it can be told how fast to drive: if all its policies can.
    """

    def __init__(
        self,
        track: Track,
        parts: Sequence[CompositePart],
        policies: Sequence[Policy],
        spec: ObservationSpec,
        strategist: Strategist | None = None,
    ) -> None:
        """A composite of parts with their policies.

        Args:
            track: the circuit to drive.
            parts: in the order in which they are asked; the last is unconditional.
            policies: one for each part.
            spec: contains what each policy sees.
            strategist: who decides when its cars stop; None if they never do.

        Raises:
            InputError: if the circuit lacks a section, or what is seen does not tell where the car is while a
                part has a condition.
        """
        if spec.version != VERSION and not all(part.unconditional for part in parts):
            raise InputError(
                f"{_layout(spec)} names no place, expected version {VERSION} where parts have conditions"
            )
        self.strategist = strategist
        self.reverse = all(map(has_reverse, policies))
        self.paced = all(map(takes_pace, policies))
        self.observation_spec = spec
        self._policies = policies
        self._columns = [columns(spec, policy.observation_spec) for policy in policies]
        widths = [policy.initial_memory(1).shape[1] for policy in policies]
        self._bounds = PLACE + np.cumsum([0, *widths[:-1]])
        self._metres = track.length / (2.0 * np.pi)
        self._until = [np.inf if part.until_m is None else part.until_m for part in parts]
        self._stretches = [
            None if part.sections is None else [track.stretch(name) for name in part.sections]
            for part in parts
        ]
        self._progress = spec.slice("progress") if spec.version == VERSION else slice(0)
        mean, deviation = (half[self._progress].astype(np.float64) for half in spec.scaling)
        self._mean, self._deviation = mean, deviation

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`; a place that is not known yet is nan."""
        place = np.full((n, PLACE), np.nan, np.float32)
        return np.concatenate([place, *(policy.initial_memory(n) for policy in self._policies)], axis=1)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """See `Policy.act`."""
        return self.act_by(lambda policy, seen, own: policy.act(seen, own), observations, memory)

    def act_by(self, ask: Ask, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """As `act`, with the parts asked by a function."""
        place, *memories = np.split(memory, self._bounds, axis=1)
        angle, place = self._follow(observations, place)
        answers = [
            ask(policy, np.ascontiguousarray(observations[:, seen]), np.ascontiguousarray(own))
            for policy, seen, own in zip(self._policies, self._columns, memories, strict=True)
        ]
        driving = self._driving(angle, place)
        actions = np.stack([actions for actions, _ in answers])[driving, np.arange(len(observations))]
        return actions, np.concatenate([place, *(own for _, own in answers)], axis=1)

    def _follow(self, observations: Batch, place: Batch) -> tuple[NDArray[np.float64], Batch]:
        """Lap angles of the cars (n,), rad from 0 to 2 pi, and where they started and have come to.

        Where nothing that is seen tells, the place stays unknown; there the first part drives everywhere.
        A car that is pushed back has still come as far as it had; so the way since the last tick is that to
        the nearest point with this lap angle.
        """
        if not len(self._mean):
            return np.zeros(len(observations)), place
        sine, cosine = (observations[:, self._progress] * self._deviation + self._mean).T
        angle = np.arctan2(sine, cosine) % (2.0 * np.pi)
        start, furthest = np.where(np.isnan(place), angle[:, None], place).T
        now = furthest + (angle - furthest + np.pi) % (2.0 * np.pi) - np.pi
        return angle, np.stack([start, np.maximum(furthest, now)], axis=1).astype(np.float32)

    def _driving(self, angle: NDArray[np.float64], place: Batch) -> NDArray[np.intp]:
        """Which part drives each car, (n,)."""
        start, furthest = place.T.astype(np.float64)
        gone = (furthest - start) * self._metres
        at = angle * self._metres
        turns = []
        for until, stretches in zip(self._until, self._stretches, strict=True):
            inside = np.full(len(at), stretches is None)
            for begin, end in stretches or ():
                inside |= (begin <= at) & (at < end)
            turns.append(inside & ~(gone >= until))
        return np.argmax(turns, axis=0)


def joint_spec(sources: Sequence[str], specs: Sequence[ObservationSpec]) -> ObservationSpec:
    """The smallest spec that contains what each of some policies sees.

    A course of one point is the beginning of any other, and shorter lists of cars that of longer ones.

    Args:
        sources: names of the policies, for the error.
        specs: of each.

    Raises:
        InputError: if two of them see different courses of more than one point, different layouts or
            different plans, or one sees by a camera.
    """
    for source, spec in zip(sources, specs, strict=True):
        if spec.camera is not None:
            raise InputError(f"{source} sees by a camera, expected parts that are told numbers")
        if spec.practised_by != specs[0].practised_by:
            raise InputError(
                f"{source} and {sources[0]} see plans that different policies have practised, "
                "expected parts that see the same"
            )
    # Whoever sees a plan sees all that is seen of any car.
    layout = max(specs, key=lambda spec: spec.version)
    for source, spec in zip(sources, specs, strict=True):
        if (spec.version == VERSION) != (layout.version == VERSION) or (
            spec.planned and spec.plan_pace != layout.plan_pace
        ):
            raise InputError(
                f"{source} sees {_layout(spec)}, {sources[specs.index(layout)]} {_layout(layout)}, "
                "expected policies that see the same"
            )
    widest = max(range(len(specs)), key=lambda index: specs[index].course_points)
    course = specs[widest]
    for source, spec in zip(sources, specs, strict=True):
        if spec.course_points > 1 and (spec.course_points, spec.horizon_s) != (
            course.course_points,
            course.horizon_s,
        ):
            raise InputError(
                f"{source} sees {spec.course_points} course points over {spec.horizon_s:g} s, "
                f"{sources[widest]} {course.course_points} over {course.horizon_s:g} s, "
                "expected policies that see the same course"
            )
    return ObservationSpec(
        course_points=course.course_points,
        horizon_s=course.horizon_s,
        cars_ahead=max(spec.cars_ahead for spec in specs),
        cars_behind=max(spec.cars_behind for spec in specs),
        version=layout.version,
        plan_pace=layout.plan_pace,
        practised_by=layout.practised_by,
        walls=any(spec.walls for spec in specs),
    )


def _told(stint: Stint) -> str:
    """A stint in an id, in which there was no pace before there were any."""
    return stint.model_dump_json(exclude={"pace"} if stint.pace == 1.0 else None)


def _layout(spec: ObservationSpec) -> str:
    pace = f" with a plan at pace {spec.plan_pace:g}" if spec.planned else ""
    return f"version {spec.version} of the observations{pace}"


def columns(spec: ObservationSpec, part: ObservationSpec) -> NDArray[np.intp]:
    """Which numbers of an observation a part sees, (part.size,), given that `spec` contains its."""
    return np.concatenate(
        [np.arange(spec.size)[spec.slice(field.name)][: field.size] for field in part.fields]
    )

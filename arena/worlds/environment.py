"""Worlds made of environments: a PettingZoo `ParallelEnv`, or a Gymnasium `Env` with its one seat."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from nathlon.arena.worlds.contract import KNOWN, Measure, Outcome, Player, Points, Setup
from nathlon.arena.worlds.episodes import EpisodeWorld
from nathlon.arena.worlds.player import Space
from nathlon.sim.errors import InputError

Factory = Callable[[], Any]
SEEDS = 2**31
"""Environments want seeds below."""
ONLY = "agent"
"""Name of the one seat of a Gymnasium environment."""


@dataclass
class Seat:
    """What has been seen of a seat in an episode.

    Attributes:
        total: sum of its rewards.
        steps: that it has made.
        terminated: whether the environment ended it, and not a time limit.
        info: its last one; what is in it stays when the seat leaves.
        infos: sums over its steps of the numbers in its infos.
    """

    total: float = 0.0
    steps: int = 0
    terminated: bool = False
    info: dict[str, Any] = field(default_factory=dict)
    infos: dict[str, float] = field(default_factory=dict)


Source = str | Callable[[Seat], float]
"""Where a number of a seat comes from: a key of its last info, or a function of what was seen of it."""


@dataclass(frozen=True)
class Declared:
    """A measure that a world declares.

    Attributes:
        source: where it comes from.
        unit, goal: as of `Measure`; taken from `KNOWN` where the name is known there.
    """

    source: Source
    unit: str = "1"
    goal: str = "max"


class PettingZooWorld(EpisodeWorld):
    """Scenarios that are `ParallelEnv`s."""

    def __init__(
        self,
        scenarios: Mapping[str, Factory],
        *,
        sides: Sequence[Sequence[str]] | None = None,
        points: Points = "score",
        score: Source = lambda seat: seat.total,
        measures: Mapping[str, Declared] | None = None,
        baseline: str = "random",
        packages: Sequence[str] = (),
        most_steps: int = 10_000,
        step_s: float = 0.1,
    ) -> None:
        """A world of environments.

        Args:
            scenarios: functions that make the environment of each, by name; the first is the filter's.
            sides: names of the seats of each side that entrants take; by default each seat is one. Seats of
                no side are the baseline's.
            points: whether points of a match are by place or by score.
            score: of a seat in an episode, the sum of its rewards by default.
            measures: what else is measured of a seat, by name.
            baseline: source of the policy that takes the other seats and sets the marks of tests.
            packages: whose versions decide how episodes go, besides this module's file.
            most_steps: of an episode; then it is cut off.
            step_s: what a step is taken to last, for sharing out the work.
        """
        self.scenarios = tuple(scenarios)
        self.measures = {
            name: KNOWN.get(name) or Measure(declared.unit, declared.goal)  # type: ignore[arg-type]
            for name, declared in (measures or {}).items()
        }
        self.baseline = baseline
        self._make, self._sides, self._points = dict(scenarios), sides, points
        self._score, self._declared = score, dict(measures or {})
        self._packages, self._most_steps, self._step_s = tuple(packages), most_steps, step_s
        self._environments: dict[str, Any] = {}

    def setup(self, scenario: str) -> Setup:
        """As of `nathlon.arena.worlds.contract.World`."""
        seats = tuple(self._environment(scenario).possible_agents)
        sides = [[seat] for seat in seats] if self._sides is None else self._sides
        unknown = {seat for side in sides for seat in side} - set(seats)
        if unknown:
            raise InputError(
                f"world {self.name!r}, scenario {scenario!r}: has no seat {sorted(unknown)[0]!r}, "
                f"expected {', '.join(seats)}"
            )
        return Setup(
            seats,
            tuple(tuple(seats.index(seat) for seat in side) for side in sides),
            self._points,
            self._most_steps * self._step_s,
        )

    def spaces(self, scenario: str) -> list[tuple[Space, Space]]:
        """As of `nathlon.arena.worlds.episodes.EpisodeWorld`."""
        environment = self._environment(scenario)
        return [
            (environment.observation_space(seat), environment.action_space(seat))
            for seat in environment.possible_agents
        ]

    def identity(self) -> dict[str, Any]:
        """The file of the module that the scenarios are made in, and the versions of the packages."""
        paths = {Path(inspect.getfile(make)) for make in self._make.values()}
        return {
            "files": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(paths)},
            "packages": {name: version(name) for name in (*self._packages, "numpy")},
        }

    def play(self, scenario: str, players: Sequence[Player], seed: int) -> list[Outcome]:
        """As of `nathlon.arena.worlds.episodes.EpisodeWorld`."""
        environment = self._environment(scenario)
        names = list(environment.possible_agents)
        seats = {name: Seat() for name in names}
        observations, infos = _two(environment.reset(seed=seed % SEEDS), "reset", names[0])
        for name in environment.agents:
            seats[name].info = dict(infos.get(name, {}))
        for _ in range(self._most_steps):
            playing = list(environment.agents)
            if not playing:
                break
            for name in playing:
                if name not in observations:
                    raise ValueError(f"seat {name!r}: no observation, though it is in agents")
            actions = {name: players[names.index(name)].act(observations[name]) for name in playing}
            observations, rewards, terminations, _, infos = _five(environment.step(actions), playing[0])
            for name in playing:
                if name not in rewards:
                    raise ValueError(f"seat {name!r}: no reward in its last step, expected a row of who left")
                _note(
                    seats[name],
                    float(rewards[name]),
                    bool(terminations.get(name, False)),
                    infos.get(name, {}),
                )
        return [self._outcome(name, seats[name]) for name in names]

    def _outcome(self, name: str, seat: Seat) -> Outcome:
        return Outcome(
            score=_number(name, "score", self._score, seat),
            finished=seat.terminated,
            measures={
                measure: _number(name, measure, declared.source, seat)
                for measure, declared in self._declared.items()
            },
        )

    def _environment(self, scenario: str) -> Any:
        if scenario not in self._make:
            raise InputError(
                f"world {self.name!r}: scenario is {scenario!r}, expected {', '.join(self.scenarios)}"
            )
        if scenario not in self._environments:
            self._environments[scenario] = self._made(self._make[scenario]())
        return self._environments[scenario]

    def _made(self, environment: Any) -> Any:
        return environment


class GymnasiumWorld(PettingZooWorld):
    """Scenarios that are Gymnasium environments: one seat, and so no tournament."""

    def _made(self, environment: Any) -> Any:
        return _Alone(environment)


class _Alone:
    """A Gymnasium environment as a `ParallelEnv` of one seat."""

    possible_agents = (ONLY,)

    def __init__(self, environment: Any) -> None:
        self._environment = environment
        self.agents: list[str] = []

    def observation_space(self, _: str) -> Space:
        return self._environment.observation_space

    def action_space(self, _: str) -> Space:
        return self._environment.action_space

    def reset(self, seed: int) -> Any:
        self.agents = [ONLY]
        observation, info = _two(self._environment.reset(seed=seed), "reset", ONLY)
        return {ONLY: observation}, {ONLY: info}

    def step(self, actions: Mapping[str, Any]) -> Any:
        observation, reward, terminated, truncated, info = _five(self._environment.step(actions[ONLY]), ONLY)
        if terminated or truncated:
            self.agents = []
        return (
            {ONLY: observation},
            {ONLY: reward},
            {ONLY: bool(terminated)},
            {ONLY: bool(truncated)},
            {ONLY: info},
        )


def _note(seat: Seat, reward: float, terminated: bool, info: Mapping[str, Any]) -> None:
    seat.total += reward
    seat.steps += 1
    seat.terminated = terminated
    seat.info |= info
    for key, value in info.items():
        if isinstance(value, bool | int | float | np.number | np.bool_):
            seat.infos[key] = seat.infos.get(key, 0.0) + float(value)


def _number(name: str, measure: str, source: Source, seat: Seat) -> float:
    if not isinstance(source, str):
        return float(source(seat))
    if source not in seat.info:
        raise ValueError(f"seat {name!r}: {measure} is to come from infos, where there is no {source!r}")
    return float(seat.info[source])


def _two(answer: Any, method: str, seat: str) -> tuple[Any, Any]:
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise ValueError(
            f"seat {seat!r}: {method} gives no (observation, info), expected the API of Gymnasium"
        )
    return answer


def _five(answer: Any, seat: str) -> tuple[Any, Any, Any, Any, Any]:
    if not isinstance(answer, tuple) or len(answer) != 5:
        count = len(answer) if isinstance(answer, tuple) else 1
        raise ValueError(
            f"seat {seat!r}: step gives {count} values, expected observation, reward, terminated, truncated "
            "and info"
        )
    return answer

"""Worlds of environments: a PettingZoo `ParallelEnv` or `AECEnv`, or a Gymnasium `Env` with its one seat."""

from __future__ import annotations

import inspect
import platform
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

from nathlon.arena.world import (
    KNOWN,
    Measure,
    Onlooker,
    Outcome,
    Player,
    Points,
    Setup,
    Space,
    WorldError,
)
from nathlon.arena.worlds.episodes import EpisodeWorld
from nathlon.arena.worlds.far_loader import FarLoader
from nathlon.arena.worlds.foreign import Foreign, Interpreter
from nathlon.arena.worlds.host import hashes, is_in_turn, parallel
from nathlon.arena.worlds.loaded import Named, by_ending
from nathlon.arena.worlds.seat_record import Declared, SeatRecord, Source
from nathlon.policies.patience import WORLD_ANSWER_S, WORLD_OPENS_S
from nathlon.sim.errors import InputError

Factory = Callable[..., Any] | str
"""A function that makes an environment; for another interpreter its name."""
SEEDS = 2**31
"""Environments want seeds below."""


class PettingZooWorld(EpisodeWorld):
    """Scenarios that are `ParallelEnv`s, or `AECEnv`s, whose seats play in turn."""

    def __init__(
        self,
        scenarios: Mapping[str, Factory],
        *,
        sides: Sequence[Sequence[str]] | None = None,
        roles: Mapping[str, Sequence[str]] | None = None,
        points: Points = "score",
        score: Source = lambda seat: seat.total,
        measures: Mapping[str, Declared] | None = None,
        baseline: str = "random",
        load: Named | Mapping[str, Named] | None = None,
        episode: str = "episode",
        packages: Sequence[str] = (),
        most_steps: int = 10_000,
        step_s: float = 0.1,
        python: str | None = None,
        answer_s: float = WORLD_ANSWER_S,
    ) -> None:
        """A world of environments.

        Args:
            scenarios: functions that make the environment of each, by name; the first is the filter's. For
                another interpreter they are `MODULE:FUNCTION` or `PATH.py:FUNCTION`; paths start from the
                folder of the file that the world is in.
            sides: names of the seats of each side that entrants take; by default each seat is one. Seats of
                no side are the baseline's.
            roles: names of the seats of each role, where an entrant has a policy for each; every seat of a
                side has one.
            points: whether points of a match are by place or by score.
            score: of a seat in an episode, the sum of its rewards by default.
            measures: what else is measured of a seat, by name.
            baseline: source of the policy that takes the other seats and sets the marks of tests.
            load: a function that makes policies of files which nathlon cannot read, see
                `nathlon.arena.worlds.loaded`; of those with the endings `WEIGHTS`, or of others by ending.
                `PATH.py:FUNCTION` runs in the other interpreter.
            episode: what its users call one, for reports: `"game"`.
            packages: whose versions decide how episodes go, besides this module's file.
            most_steps: of an episode; then it is cut off.
            step_s: what a step is taken to last, for sharing out the work and in replays.
            python: path of another interpreter, in which the environments run; it needs numpy.
            answer_s: time that an environment has for a step, s; one that takes longer hangs.

        Raises:
            ValueError: if a scenario is a name where there is no other interpreter, or none where there is;
                or if `load` is no function.
        """
        for name, make in scenarios.items():
            if isinstance(make, str) != (python is not None):
                wanted = "a function" if python is None else "MODULE:FUNCTION or PATH.py:FUNCTION"
                raise ValueError(f"scenario {name!r} is {make!r}, expected {wanted}")
        self.scenarios = tuple(scenarios)
        self.measures = {
            name: KNOWN.get(name, Measure(declared.unit, declared.goal))
            for name, declared in (measures or {}).items()
        }
        self.baseline, self.episode = baseline, episode
        self._make, self._sides, self._points = dict(scenarios), sides, points
        self._roles = {seat: role for role, named in (roles or {}).items() for seat in named}
        self._score, self._declared = score, dict(measures or {})
        self._packages, self.most_steps, self._step_s = tuple(packages), most_steps, step_s
        self._python, self._answer_s = python, answer_s
        self.loaders = by_ending(load, None if python is None else self._far_loader)
        # A process of its own is ended first, which voids the episode alone.
        self.answer_s = answer_s if python is None else 3 * max(WORLD_OPENS_S, answer_s)
        self._environments: dict[str, Any] = {}
        self._spaces: dict[str, dict[str, tuple[Space, Space]]] = {}

    def setup(self, scenario: str) -> Setup:
        """As of `nathlon.arena.world.World`."""
        seats = tuple(self._known(scenario))
        sides = [[seat] for seat in seats] if self._sides is None else self._sides
        taken = {seat for side in sides for seat in side}
        where = f"world {self.name!r}, scenario {scenario!r}"
        unknown = (taken | self._roles.keys()) - set(seats)
        if unknown:
            raise InputError(f"{where}: has no seat {sorted(unknown)[0]!r}, expected {', '.join(seats)}")
        if self._roles and (without := taken - self._roles.keys()):
            raise InputError(
                f"{where}: seat {sorted(without)[0]!r} has no role, expected one for every seat of a side"
            )
        return Setup(
            seats,
            tuple(tuple(seats.index(seat) for seat in side) for side in sides),
            self._points,
            self.most_steps * self._step_s,
            roles=tuple(self._roles.get(seat, "") for seat in seats) if self._roles else (),
        )

    def spaces(self, scenario: str) -> list[tuple[Space, Space]]:
        """As of `nathlon.arena.worlds.episodes.EpisodeWorld`."""
        return list(self._known(scenario).values())

    def identity(self) -> dict[str, Any]:
        """Hashes of the files that the world and its scenarios are in, and the versions of the packages."""
        return self._identity

    @cached_property
    def _identity(self) -> dict[str, Any]:
        loaders = [one.file if isinstance(one, FarLoader) else _source(one) for one in self.loaders.values()]
        own = {path for path in (self.file, *map(_source, self._make.values()), *loaders) if path}
        files: dict[str, str] = {}
        for path in own:
            files |= hashes(str(path))
        if self._python is None:
            packages = {name: version(name) for name in (*self._packages, "numpy")}
            return {"files": files, "packages": packages | {"python": platform.python_version()}}
        told = [self.environment(scenario).identity for scenario in self.scenarios]
        for there in told:
            files |= there["files"]
        return {"files": files, "packages": told[0]["packages"]}

    def play(self, scenario: str, players: Sequence[Player], seed: int) -> list[Outcome]:
        """As of `nathlon.arena.worlds.episodes.EpisodeWorld`."""
        return self.show(scenario, players, seed, _nobody)

    def wrappers(self, scenario: str) -> set[str]:
        """As of `nathlon.arena.worlds.episodes.EpisodeWorld`."""
        made: Any = self.environment(scenario)
        found: set[str] = set()
        while made is not None:
            found.add(type(made).__name__)
            made = vars(made).get("env", vars(made).get("_environment"))
        return found

    def made_with(self, scenario: str) -> Mapping[str, Any] | None:
        """As of `nathlon.arena.worlds.episodes.EpisodeWorld`."""
        made: Any = self.environment(scenario)
        spec = getattr(vars(made).get("_environment", made), "spec", None)
        kwargs = getattr(spec, "kwargs", None)
        return kwargs if isinstance(kwargs, Mapping) else None

    def shows(self, scenario: str) -> bool:
        """Whether the environment was made with the render mode `rgb_array`."""
        return getattr(self.environment(scenario), "render_mode", None) == "rgb_array"

    def show(self, scenario: str, players: Sequence[Player], seed: int, onlooker: Onlooker) -> list[Outcome]:
        """As of `nathlon.arena.worlds.episodes.EpisodeWorld`: what `render` of the environment gives."""
        environment = self.environment(scenario)
        try:
            return self._played(environment, players, seed, onlooker)
        except BaseException:
            self.forget(scenario)
            raise

    def forget(self, scenario: str) -> None:
        """Give up the environment of a scenario: it may be in any state, or its process gone."""
        environment = self._environments.pop(scenario)
        with suppress(Exception):
            environment.close()

    def _played(
        self, environment: Any, players: Sequence[Player], seed: int, onlooker: Onlooker
    ) -> list[Outcome]:
        names = list(environment.possible_agents)
        seats = {name: SeatRecord() for name in names}

        def draw() -> Any:
            return environment.render()

        with during("reset"):
            observations, infos = _two(environment.reset(seed=seed % SEEDS), names[0])
            for name in environment.agents:
                seats[name].info = dict(infos.get(name, {}))
            onlooker(0.0, draw, False)
        for step in range(self.most_steps):
            playing = list(environment.agents)
            if not playing:
                break
            with during(f"step {step}"):
                for name in playing:
                    if name not in observations:
                        raise WorldError(f"seat {name!r}: no observation, though it is in agents")
                actions = {
                    name: players[names.index(name)].act(
                        observations[name], _mask(environment, infos.get(name, {}))
                    )
                    for name in playing
                }
                observations, rewards, ends, _, infos = _five(environment.step(actions), playing[0])
                for name in playing:
                    seats[name].steps += 1
                for name in rewards if is_in_turn(environment) else playing:
                    if name not in rewards:
                        raise WorldError(f"seat {name!r}: no reward, expected that of its last step")
                    ended = bool(ends.get(name, False))
                    seats[name].note(float(rewards[name]), ended, infos.get(name, {}))
                over = not environment.agents or step + 1 == self.most_steps
                onlooker((step + 1) * self._step_s, draw, over)
        return [self.outcome(name, seats[name]) for name in names]

    def outcome(self, name: str, seat: SeatRecord) -> Outcome:
        """What came of an episode for a seat."""
        return Outcome(
            score=seat.number(name, "score", self._score),
            finished=seat.terminated,
            measures={
                measure: seat.number(name, measure, declared.source)
                for measure, declared in self._declared.items()
            },
        )

    @property
    def foreign(self) -> bool:
        """Whether the environments run in another interpreter."""
        return self._python is not None

    def _known(self, scenario: str) -> dict[str, tuple[Space, Space]]:
        """Spaces of observations and actions of the seats; kept, as an environment may not live as long."""
        if scenario not in self._spaces:
            environment = self.environment(scenario)
            self._spaces[scenario] = {
                seat: (environment.observation_space(seat), environment.action_space(seat))
                for seat in environment.possible_agents
            }
        return self._spaces[scenario]

    def environment(self, scenario: str) -> Any:
        """The environment of a scenario, made when it is needed.

        Raises:
            InputError: if there is no such scenario, or it cannot be made.
        """
        if scenario not in self._make:
            raise InputError(
                f"world {self.name!r}: scenario is {scenario!r}, expected {', '.join(self.scenarios)}"
            )
        if scenario not in self._environments:
            try:
                self._environments[scenario] = self.made(scenario)
            except (MemoryError, InputError):
                raise
            # It is foreign code: whatever it raises, the user wants to know whose it is.
            except (Exception, SystemExit) as error:
                raise InputError(
                    f"world {self.name!r}, scenario {scenario!r}: cannot be made: {_said(error)}"
                ) from error
        return self._environments[scenario]

    def made(self, scenario: str) -> Any:
        """A new environment of a scenario."""
        make = self._make[scenario]
        if isinstance(make, str):
            return Foreign(self._interpreter, make, self._answer_s)
        return parallel(self.make(scenario))

    @property
    def _interpreter(self) -> Interpreter:
        assert self._python is not None
        return Interpreter(self._python, Path() if self.file is None else self.file.parent, self._packages)

    def _far_loader(self, name: str) -> FarLoader:
        first = self.scenarios[0]
        make = self._make[first]
        assert isinstance(make, str)
        return FarLoader(name, lambda: self._interpreter, make, lambda: self.spaces(first))

    def make(self, scenario: str, *arguments: Any) -> Any:
        """What the function of a scenario makes."""
        with redirect_stdout(sys.stderr):  # what it prints is no output of ours
            make = self._make[scenario]
            assert not isinstance(make, str)
            return make(*arguments)


class GymnasiumWorld(PettingZooWorld):
    """Scenarios that are Gymnasium environments: one seat, and so no tournament."""


def _nobody(time_s: float, draw: Callable[[], Any], last: bool) -> None:
    """Nobody looks on."""


@contextmanager
def during(what: str) -> Iterator[None]:
    """Have what goes wrong in an environment say when it did."""
    try:
        yield
    except MemoryError:
        raise
    except (Exception, SystemExit) as error:
        raise WorldError(f"{what}: {_said(error)}") from error


def _said(error: BaseException) -> str:
    return str(error) if isinstance(error, WorldError) else f"{type(error).__name__} ({error})"


def _source(make: Any) -> Path | None:
    """The file of what makes an environment, a function or an object that is called; None without one."""
    make = getattr(make, "func", make)  # of a functools.partial
    for one in (make, type(make)):
        with suppress(TypeError, OSError):
            path = Path(inspect.getfile(one))
            return path if path.is_file() else None
    return None


def _mask(environment: Any, info: Mapping[str, Any]) -> Any:
    """Which choices a seat has, as its info or the environment says; None where neither does."""
    told = info.get("action_mask")
    masks = getattr(environment, "action_masks", None)
    return masks() if told is None and callable(masks) else told


def _two(answer: Any, seat: str) -> tuple[Any, Any]:
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise WorldError(f"seat {seat!r}: gives no observation and info, expected the API of Gymnasium 0.26")
    return answer


def _five(answer: Any, seat: str) -> tuple[Any, Any, Any, Any, Any]:
    if not isinstance(answer, tuple) or len(answer) != 5:
        count = len(answer) if isinstance(answer, tuple) else 1
        raise WorldError(
            f"seat {seat!r}: gives {count} values, expected observation, reward, terminated, truncated, info"
        )
    return answer

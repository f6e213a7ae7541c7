"""The process in which another interpreter plays a world's scenario: `PYTHON host.py DESCRIPTOR WIRE`.

It is run by path and needs the standard library and numpy alone, in Python 3.7 or newer. The file WIRE is
`nathlon/policies/hosting/wire.py`. Where a loader is asked for as well, it is policies that play, see
`policies_host.py` beside this file. Environments of PettingZoo, those in turns too, of Gymnasium and the Gym
before it are all made to answer as a PettingZoo `ParallelEnv` does; seats go by their numbers.
"""

from __future__ import annotations

import hashlib
import importlib
import inspect
import os
import platform
import random
import sys
from importlib.util import module_from_spec, spec_from_file_location
from modulefinder import ModuleFinder
from types import ModuleType
from typing import Any

import numpy as np

ONLY = "agent"
"""Name of the one seat of a Gymnasium environment."""
INSTALLED = frozenset(["site-packages", "dist-packages"])
"""Names of the folders of installed packages."""


class Host:
    """An environment, and what is asked of it.

    Every answer is a message and arrays; see WIRE.
    """

    def __init__(self, wanted: dict[str, Any]) -> None:
        """Make the environment that is wanted."""
        factory = _factory(wanted["factory"])
        self._environment = parallel(factory())
        self._names = list(self._environment.possible_agents)
        self._file = _source(factory)
        self._packages = wanted["packages"]

    def spaces(self, number: int) -> tuple[Any, Any]:
        """Of the observations and actions of a seat."""
        name = self._names[number]
        return (
            _of(self._environment, "observation_space", name),
            _of(self._environment, "action_space", name),
        )

    def described(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Seats with their spaces, and what decides how episodes go."""
        arrays: dict[str, Any] = {}
        seats = []
        for number, name in enumerate(self._names):
            seen, done = self.spaces(number)
            told_of = _space(name, "observation", seen, arrays), _space(name, "action", done, arrays)
            seats.append([str(name), *told_of])
        versions = {name: _version(name) for name in self._packages}
        versions.update(python=platform.python_version(), numpy=np.__version__)
        files = {} if self._file is None else hashes(self._file)
        mode = str(getattr(self._environment, "render_mode", ""))
        told: dict[str, Any] = {"seats": seats, "versions": versions, "files": files, "render_mode": mode}
        told["in_turn"] = is_in_turn(self._environment)
        return told, arrays

    def reset(self, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode: observations and infos of the seats that play."""
        # Environments older than generators that are passed in draw from those of the process.
        random.seed(seed)
        np.random.seed(seed)  # noqa: NPY002
        environment = self._environment
        try:
            answer = environment.reset(seed=seed)
        except TypeError as error:
            if "seed" not in str(error):
                raise
            if hasattr(environment, "seed"):
                environment.seed(seed)
            answer = environment.reset()
        two = isinstance(answer, tuple) and len(answer) == 2
        observations, infos = answer if two else (answer, {})  # of old there were no infos
        return self._told(observations, infos, {})

    def step(self, actions: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Make a step with the actions of the seats that play, by their numbers."""
        playing = {
            name: _action(_of(self._environment, "action_space", name), actions[str(number)])
            for number, name in enumerate(self._names)
            if str(number) in actions
        }
        answer = self._environment.step(playing)
        if not isinstance(answer, tuple) or len(answer) not in (4, 5):
            count = len(answer) if isinstance(answer, tuple) else 1
            raise ValueError(f"step gives {count} values, expected 5, or the 4 of old")
        if len(answer) == 5:
            observations, rewards, ends, cuts, infos = answer
        else:
            observations, rewards, dones, infos = answer
            cuts = {name: done and _cut(infos.get(name)) for name, done in dones.items()}
            ends = {name: done and not cuts[name] for name, done in dones.items()}
        heard = self._names if is_in_turn(self._environment) else list(playing)
        numbers = {name: str(self._names.index(name)) for name in heard if name in rewards}
        told = {
            "rewards": {number: float(rewards[name]) for name, number in numbers.items()},
            "terminations": {number: bool(ends.get(name, False)) for name, number in numbers.items()},
            "truncations": {number: bool(cuts.get(name, False)) for name, number in numbers.items()},
        }
        return self._told(observations, infos, told)

    def render(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """A picture of how it stands."""
        return {}, {"picture": np.asarray(self._environment.render())}

    def answer(
        self, message: dict[str, Any], arrays: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Do what is asked for: to begin with a seed, to draw, or else to make a step."""
        if "seed" in message:
            return self.reset(message["seed"])
        return self.render() if "render" in message else self.step(arrays)

    def _told(
        self, observations: dict[Any, Any], infos: dict[Any, Any], told: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        numbers = {name: str(number) for number, name in enumerate(self._names)}
        told["agents"] = [int(numbers[name]) for name in self._environment.agents]
        told["infos"] = {
            number: _numbers(infos[name]) for name, number in numbers.items() if infos and name in infos
        }
        arrays = {}
        for name, number in numbers.items():
            if name in observations:
                arrays[number] = np.asarray(observations[name])
                if arrays[number].dtype.kind not in "biuf":
                    kind = arrays[number].dtype
                    raise ValueError(f"seat {name!r}: the observation is of {kind}, expected numbers")
        return told, arrays


class Alone:
    """A Gym or Gymnasium environment as a `ParallelEnv` of one seat."""

    possible_agents = (ONLY,)

    def __init__(self, environment: Any) -> None:
        self._environment = environment
        self.agents: list[str] = []
        self.render_mode = getattr(environment, "render_mode", None)
        if hasattr(environment, "seed"):
            self.seed = environment.seed
        masks = _method(environment, "action_masks")
        if masks is not None:
            self.action_masks = masks

    def observation_space(self, _: str) -> Any:
        return self._environment.observation_space

    def action_space(self, _: str) -> Any:
        return self._environment.action_space

    def render(self) -> Any:
        return self._environment.render()

    def reset(self, **seed: int) -> Any:
        answer = self._environment.reset(**seed)
        self.agents = [ONLY]
        two = isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[1], dict)
        return ({ONLY: answer[0]}, {ONLY: answer[1]}) if two else {ONLY: answer}

    def step(self, actions: dict[str, Any]) -> Any:
        answer = self._environment.step(actions[ONLY])
        if isinstance(answer, tuple) and len(answer) in (4, 5):
            if any(answer[2:-1]):
                self.agents = []
            return tuple({ONLY: value} for value in answer)
        return answer


class InTurn:
    """A PettingZoo `AECEnv` as a `ParallelEnv` in which one seat plays at a time: whose turn it is.

    A step tells rewards when a seat hears of them: with its next observation, or at its end.

    Attributes:
        environment: the `AECEnv`.
    """

    in_turn = True

    def __init__(self, environment: Any) -> None:
        self.environment = environment
        self.possible_agents = list(environment.possible_agents)
        self.agents: list[Any] = []
        self.render_mode = getattr(environment, "render_mode", None)

    def observation_space(self, name: Any) -> Any:
        return self.environment.observation_space(name)

    def action_space(self, name: Any) -> Any:
        return self.environment.action_space(name)

    def render(self) -> Any:
        return self.environment.render()

    def close(self) -> None:
        self.environment.close()

    def reset(self, **seed: int) -> Any:
        self.environment.reset(**seed)
        observations, _, _, _, infos = self._heard()
        return observations, infos

    def step(self, actions: dict[str, Any]) -> Any:
        (action,) = actions.values()
        self.environment.step(action)
        return self._heard()

    def _heard(self) -> Any:
        """What those hear who are out, and the next who plays."""
        observations: dict[Any, Any] = {}
        rewards: dict[Any, float] = {}
        ends: dict[Any, bool] = {}
        cuts: dict[Any, bool] = {}
        infos: dict[Any, Any] = {}
        self.agents = []
        while self.environment.agents:
            name = self.environment.agent_selection
            observation, reward, ends[name], cuts[name], infos[name] = self.environment.last()
            rewards[name] = rewards.get(name, 0.0) + reward
            if not (ends[name] or cuts[name]):
                observations[name], self.agents = observation, [name]
                break
            self.environment.step(None)
        return observations, rewards, ends, cuts, infos


def parallel(environment: Any) -> Any:
    """An environment that answers as a `ParallelEnv` does."""
    if callable(getattr(environment, "agent_iter", None)):
        return InTurn(environment)
    return environment if hasattr(environment, "possible_agents") else Alone(environment)


def is_in_turn(environment: Any) -> bool:
    """Whether one seat plays at a time, and others hear of rewards meanwhile."""
    return bool(getattr(environment, "in_turn", False))


def _method(environment: Any, name: str) -> Any:
    """A method of an environment or of what it wraps; None without one."""
    while environment is not None:
        # Not by the instance: wrappers of old hand on whatever they are asked for, with a warning.
        if hasattr(type(environment), name):
            return getattr(environment, name)
        environment = vars(environment).get("env")
    return None


def main() -> None:
    """Make the environment that is asked for, and play until nobody asks any more."""
    wire: Any = _from_file(sys.argv[2], "wire")
    pipe = wire.pipe_to_parent()
    wanted, _ = next(wire.messages(pipe))
    # This file's own folder has no modules of the environment's.
    sys.path[:] = [folder for folder in sys.path if folder != os.path.dirname(os.path.abspath(__file__))]
    sys.path.insert(0, wanted["folder"])
    try:
        host: Any = Host(wanted)
        if "loader" in wanted:
            beside = os.path.join(os.path.dirname(os.path.abspath(__file__)), "policies_host.py")
            host = _from_file(beside, "nathlon_policies").Policies(host.spaces, _factory(wanted["loader"]))
        answer = wire.pack(*host.described())
    except BaseException as error:
        pipe.send_bytes(wire.raised(error))
        return
    pipe.send_bytes(answer)
    wire.serve(pipe, host.answer)


def _factory(name: str) -> Any:
    place, _, function = name.rpartition(":")
    if not place.endswith(".py"):
        return getattr(importlib.import_module(place), function)
    if os.path.dirname(place) not in sys.path:
        sys.path.insert(0, os.path.dirname(place))
    return getattr(_from_file(place, "nathlon_scenario"), function)


def hashes(path: str) -> dict[str, str]:
    """SHA-256 of a file and of the modules beside it that it imports, by their paths from its folder.

    Those of installed packages are left out: they go by the package's version.
    """
    folder, files = os.path.dirname(os.path.abspath(path)), {os.path.basename(path): path}
    if path.endswith(".py") and not INSTALLED.intersection(folder.split(os.sep)):
        finder = ModuleFinder([folder])
        finder.run_script(path)
        modules: Any = finder.modules
        found = [module.__file__ for module in modules.values() if module.__file__]
        files.update((os.path.relpath(file, folder).replace(os.sep, "/"), file) for file in found)
    told = {}
    for name in files:
        with open(files[name], "rb") as file:
            told[name] = hashlib.sha256(file.read()).hexdigest()
    return told


def _source(factory: Any) -> Any:
    factory = getattr(factory, "func", factory)  # of a functools.partial
    for one in (factory, type(factory)):
        try:
            return inspect.getsourcefile(one)
        except (TypeError, OSError):
            continue
    return None


def _from_file(path: str, name: str) -> ModuleType:
    spec = spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _of(environment: Any, method: str, name: Any) -> Any:
    """The space of a seat; the first versions of PettingZoo had dictionaries of them."""
    if callable(getattr(environment, method, None)):
        return getattr(environment, method)(name)
    return getattr(environment, method + "s")[name]


def _space(seat: Any, what: str, space: Any, arrays: dict[str, Any]) -> dict[str, Any]:
    """A space by the name of its class, as Gym's and Gymnasium's are two; its arrays by numbers."""
    kinds = [kind.__name__ for kind in type(space).__mro__]
    if "Box" in kinds:
        bounds = [_kept(bound, arrays) for bound in (space.low, space.high)]
        return {"kind": "Box", "dtype": np.dtype(space.dtype).str, "low": bounds[0], "high": bounds[1]}
    if "MultiDiscrete" in kinds:
        start = getattr(space, "start", np.zeros_like(space.nvec))
        return {"kind": "MultiDiscrete", "nvec": _kept(space.nvec, arrays), "start": _kept(start, arrays)}
    if "Discrete" in kinds:
        return {"kind": "Discrete", "n": int(space.n), "start": int(getattr(space, "start", 0))}
    raise ValueError(
        f"seat {seat!r}: the {what} space is a {kinds[0]}, expected Box, Discrete or MultiDiscrete: "
        "have the function flatten it"
    )


def _kept(array: Any, arrays: dict[str, Any]) -> str:
    name = str(len(arrays))
    arrays[name] = np.asarray(array)
    return name


def _action(space: Any, given: Any) -> Any:
    if given.ndim == 0 and "Discrete" in [kind.__name__ for kind in type(space).__mro__]:
        return int(given)
    return given.copy()  # for an environment may write into it


def _cut(info: Any) -> bool:
    """Whether an episode of the Gym of old was ended by its time limit."""
    return isinstance(info, dict) and bool(info.get("TimeLimit.truncated", False))


def _numbers(info: Any) -> dict[str, Any]:
    """What of an info are numbers: the rest stays where it is."""
    if not isinstance(info, dict):
        return {}
    return {
        key: value.item() if isinstance(value, np.generic) else value
        for key, value in info.items()
        if isinstance(key, str) and isinstance(value, (bool, int, float, np.number, np.bool_))
    }


def _version(package: str) -> str:
    try:
        from importlib.metadata import version
    except ImportError:  # Python 3.7
        from pkg_resources import get_distribution  # type: ignore[import-not-found]

        return str(get_distribution(package).version)
    return version(package)


if __name__ == "__main__":
    main()

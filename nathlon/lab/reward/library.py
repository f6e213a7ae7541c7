"""The library: clips of drivers that anybody has, good and bad, on which formulas are tried at no cost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from nathlon.lab.reward.clips import Clips, Studio, kept
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.load import load_policy
from nathlon.policies.policy import Batch, Policy
from nathlon.sim.observation import ObservationSpec

DRIVER = "driver"
"""The built-in driver at its full pace: the measure of `pace_share`."""
STILL = "still"
"""A car that stands."""
STEADY = (
    "driver:pace=0.95",
    "driver:pace=0.85",
    "driver:pace=0.7",
    "driver:pace=0.5",
    "driver:pace=1.08",
    "driver:pace=0.95,lane=4.5",
    "driver:pace=1.02,early=30",
)
NOISE = (0.1, 0.25, 0.5)
"""On the actions of built-in drivers that are unsteady."""
LASTING = 0.8
"""Share of the noise that is left a step later."""
BUNDLED_MOST = 6


class Unsteady:
    """A policy whose actions are disturbed.

    Args:
        policy: the policy.
        noise: standard deviation of what is added.
        rng: draws it.
    """

    def __init__(self, policy: Policy, noise: float, rng: np.random.Generator) -> None:
        self.observation_spec: ObservationSpec = policy.observation_spec
        self._policy, self._noise, self._rng = policy, noise, rng

    def initial_memory(self, n: int) -> Batch:
        """That of the policy, and the noise of the last step, two columns."""
        return np.concatenate([self._policy.initial_memory(n), np.zeros((n, 2), np.float32)], axis=1)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """The policy's actions, disturbed."""
        actions, inner = self._policy.act(observations, memory[:, :-2])
        drawn = self._rng.normal(0.0, self._noise * np.sqrt(1.0 - LASTING**2), actions.shape)
        noise = (LASTING * memory[:, -2:] + drawn).astype(np.float32)
        return np.clip(actions + noise, -1.0, 1.0), np.concatenate([inner, noise], axis=1)


class Parked:
    """Brakes, whatever it sees; for the arguments see `nathlon.policies.policy.Policy`."""

    def __init__(self, spec: ObservationSpec) -> None:
        self.observation_spec = spec

    def initial_memory(self, n: int) -> Batch:
        """None: (n, 0)."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """The brake, (n, 2)."""
        return np.tile(np.array([-1.0, 0.0], np.float32), (len(observations), 1)), memory


def drivers(circuit: str, car: str, rng: np.random.Generator) -> dict[str, Callable[[], Policy]]:
    """Who drive the library's clips, by name."""

    def named(source: str) -> Callable[[], Policy]:
        return lambda: load_policy(source, circuit, car)

    def unsteady(noise: float, stream: np.random.Generator) -> Callable[[], Policy]:
        return lambda: Unsteady(load_policy(DRIVER, circuit, car), noise, stream)

    found = {source: named(source) for source in (DRIVER, *STEADY)}
    for noise, stream in zip(NOISE, rng.spawn(len(NOISE)), strict=True):
        found[f"unsteady {noise:g}"] = unsteady(noise, stream)
    found[STILL] = lambda: Parked(load_policy(DRIVER, circuit, car).observation_spec)
    files = sorted((BUNDLED / circuit).glob("*.safetensors"))
    every = max(len(files) // BUNDLED_MOST, 1)
    for path in files[::every][:BUNDLED_MOST]:
        found[path.stem] = named(str(path))
    return found


def library(
    studio: Studio, folder: Path, seed: int, on_clip: Callable[[int, int], None] = lambda *_: None
) -> dict[str, Clips]:
    """The library's clips by driver; what the folder keeps is not driven again.

    Args:
        studio: where they are made.
        folder: keeps them.
        seed: of what is drawn.
        on_clip: told how many drivers have driven, and of how many.
    """
    found: dict[str, Clips] = {}
    who = drivers(studio.circuit, studio.car, np.random.default_rng([seed, 1]))
    for number, (name, make) in enumerate(who.items()):
        on_clip(number, len(who))
        place = folder / f"{number:02d}"
        if not kept(place):
            studio.film(make(), name)[0].save(place)
        found[name] = Clips.load(place)
    on_clip(len(who), len(who))
    return found

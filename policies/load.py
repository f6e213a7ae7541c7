"""Policies by name: files of weights, built-in drivers and policies of installed packages."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from nathlon.policies.checkpoint import NetworkPolicy, SeeingPolicy, open_checkpoint, read_checkpoint
from nathlon.policies.driver import Driver
from nathlon.policies.driver.early_braker import EarlyBraker
from nathlon.policies.memory_limit import memory_limit
from nathlon.policies.planning import Mppi, RolloutDriver
from nathlon.policies.planning.prior import Prior
from nathlon.policies.policy import Policy
from nathlon.policies.sb3_racer import Sb3Policy
from nathlon.policies.sources import (
    COMPOSITE,
    DRIVER,
    HUMAN,
    MPPI,
    OBJECT,
    PLUGIN,
    driver_settings,
    suffix_of,
)
from nathlon.policies.sources.composite import CompositeSource
from nathlon.policies.sources.handed_over import handed_over
from nathlon.policies.sources.human import load_person
from nathlon.policies.sources.onnx import OnnxPolicy
from nathlon.policies.sources.planned import PlannedSource
from nathlon.policies.sources.plugin import load_plugin
from nathlon.policies.sources.recognised import EXPORT, recognised
from nathlon.sim.errors import InputError

FilePolicy = NetworkPolicy | SeeingPolicy | Sb3Policy | OnnxPolicy


def load_policy(name: str, circuit: str, car: str) -> Policy:
    """The policy called `name`, made for a circuit and car.

    Args:
        name: path of a file of weights or of a composite (`.toml`), `driver` with settings
            (`driver:pace=0.95,lane=2.5`; with `early=30` it brakes 30 m before it must;
            with `temper=calm` it keeps clear of others; with `rollout=5` it tries ways past them, five
            seconds ahead), `plugin:NAME`,
            `human:FILE` of a person's inputs, `mppi:FILE?objective=EXPRESSION` of one that plans, or
            `object:NAME` of one that this process has been given.
        circuit: the circuit to drive.
        car: the car to drive.

    Raises:
        InputError: if there is no such policy or it cannot be read.
    """
    kind, _, settings = name.partition(":")
    if kind == DRIVER:
        asked = driver_settings(name)
        if asked.rollout:
            return RolloutDriver(circuit, car, asked.pace, asked.grip, asked.temper, asked.rollout)
        return _driver(name, circuit, car)
    if kind == PLUGIN:
        return load_plugin(settings, circuit, car)
    if kind == OBJECT:
        return handed_over(name)
    if kind == HUMAN:
        return load_person(Path(settings), circuit, car)
    if kind == MPPI:
        return _planner(PlannedSource.read(name))
    if name.endswith(COMPOSITE):
        return CompositeSource.read(Path(name)).load(circuit, car, load_policy)
    return load_file(Path(name))


def load_file(path: Path) -> FilePolicy:
    """The policy in a file: a checkpoint, a `.zip` of Stable-Baselines3 or an `.onnx` graph.

    Raises:
        InputError: if there is no such file, no policy in it that can drive, or opening it takes too much
            memory.
    """
    with memory_limit():
        match suffix_of(path):
            case ".zip":
                return Sb3Policy.load(path)
            case ".onnx":
                return OnnxPolicy.load(path)
        if what := recognised(path):
            raise InputError(f"{path}: is {what}, which only the code that trained it can read, {EXPORT}")
        return open_checkpoint(path)


def _planner(source: PlannedSource) -> Mppi:
    with memory_limit():
        card, tensors = read_checkpoint(source.path)
        if card.vision:
            raise InputError(f"{source.path}: sees by a camera, expected a policy that is told numbers")
        prior = Prior(card, tensors)
    return Mppi(prior, source.identity, source.objective)


@lru_cache(maxsize=1000)
def _driver(source: str, circuit: str, car: str) -> Policy:
    settings = driver_settings(source)
    driver = Driver(circuit, car, settings.pace, settings.lane, settings.grip, settings.temper)
    return EarlyBraker(driver, circuit, settings.early) if settings.early else driver

"""Policies of any environment with flat observations, read as data: files, plugins, and one that draws."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Space

from nathlon.policies.general.checkpoint import load_general_checkpoint
from nathlon.policies.general.onnx import load_onnx
from nathlon.policies.general.outputs import Draw
from nathlon.policies.general.plugin import load_general_plugin
from nathlon.policies.general.policy import GeneralPolicy, Memoryless
from nathlon.policies.general.sb3 import load_sb3
from nathlon.policies.memory_limit import memory_limit
from nathlon.policies.sources import PLUGIN, RANDOM, suffix_of
from nathlon.policies.sources.recognised import LOADER, recognised
from nathlon.sim.errors import InputError


def load_general(
    source: str, observation_space: Space[Any] | None = None, action_space: Space[Any] | None = None
) -> GeneralPolicy:
    """The policy that a user calls by a path or a name.

    Args:
        source: path of a `.zip` of Stable-Baselines3, an `.onnx` graph or a `.safetensors` of
            `GymnasiumTraining`; `plugin:NAME`, or `random`.
        observation_space, action_space: which a plugin is made for, and which any policy must fit where they
            are given.

    Raises:
        InputError: if there is no such policy, it cannot be read, does not fit the spaces, or opening it
            takes too much memory.
    """
    policy = _load(source, observation_space, action_space)
    if observation_space is not None and action_space is not None:
        policy.check(observation_space, action_space)
    return policy


def _load(
    source: str, observation_space: Space[Any] | None, action_space: Space[Any] | None
) -> GeneralPolicy:
    kind, _, name = source.partition(":")
    if source == RANDOM:
        nothing = Memoryless(lambda observations: np.zeros((len(observations), 0), np.float32))
        return GeneralPolicy(RANDOM, RANDOM, RANDOM, None, None, None, nothing, Draw())
    if kind == PLUGIN:
        if observation_space is None or action_space is None:
            raise InputError(f"{source}: is made for two spaces, expected them to be given")
        return load_general_plugin(name, observation_space, action_space)
    path = Path(source)
    with memory_limit():
        match suffix_of(path):
            case ".zip":
                return load_sb3(path, observation_space)
            case ".onnx":
                return load_onnx(path, observation_space)
        if what := recognised(path):
            raise InputError(f"{path}: is {what}, which only the code that trained it can read, {LOADER}")
        return load_general_checkpoint(path)

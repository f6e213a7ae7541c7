"""Policies that Stable-Baselines3 saved: the actor's weights of a `.zip`, read as data.

Of the archive's members two are read: `policy.pth`, by torch with `weights_only`, and the plain values of
`data`, a JSON object. What is pickled in `data` stays as it is. The weights do not show which functions stand
between the layers, but Stable-Baselines3 writes the settings that tell as plain text beside the pickles
(`stable_baselines3.common.save_util.data_to_json`).
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count, takewhile
from pathlib import Path
from typing import Any, Literal

import numpy as np

from nathlon.policies.checkpoint import ACTION_SIZE, CARD_KEY, MOST_COUNT, parse_card
from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.sources.archive import unpack
from nathlon.policies.sources.foreign import ForeignCard, observation_spec
from nathlon.policies.sources.policy_file import content_id, opening, read_policy_file
from nathlon.policies.sources.state_dict import read_state_dict
from nathlon.policies.sources.strict_json import parse_json
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need

MOST_SETTINGS = 1 << 25
"""Bytes of `data`, with the last observations of all environments in it."""


@dataclass(frozen=True)
class _Family:
    """The actors of one policy class.

    Attributes:
        algorithm: which trains it.
        body: prefix of the layers, whose numbers are even.
        head: name of the last layer where it stands apart from the body.
        hidden, output: functions of the network, unless the settings name another one for `hidden`.
    """

    algorithm: str
    body: str
    head: tuple[str, ...]
    hidden: Literal["relu", "tanh"]
    output: Literal["tanh", "clip"]


_FAMILIES = {
    "stable_baselines3.sac.policies": _Family("SAC", "actor.latent_pi", ("actor.mu",), "relu", "tanh"),
    "sb3_contrib.tqc.policies": _Family("TQC", "actor.latent_pi", ("actor.mu",), "relu", "tanh"),
    "stable_baselines3.td3.policies": _Family("TD3 or DDPG", "actor.mu", (), "relu", "tanh"),
    "stable_baselines3.common.policies": _Family(
        "PPO or A2C", "mlp_extractor.policy_net", ("action_net",), "tanh", "clip"
    ),
}
"""By the module of the policy class."""

_ACTIVATIONS: dict[str, Literal["relu", "tanh"]] = {
    "<class 'torch.nn.modules.activation.ReLU'>": "relu",
    "<class 'torch.nn.modules.activation.Tanh'>": "tanh",
}
_UNSEEN = ("features_extractor_class", "squash_output")
"""Settings that change what a network does, but not its weights."""
_NOT_DRIVING = (
    "critic.",
    "critic_target.",
    "actor_target.",
    "value_net.",
    "mlp_extractor.value_net.",
    "log_std",
    "actor.log_std",
)
"""Prefixes of tensors that have no part in the action without noise."""


class Sb3Policy:
    """An actor from Stable-Baselines3 or sb3-contrib: drives without noise.

    Attributes:
        card: what is known of the policy.
        id: SHA-256 of the file.
        observation_spec: layout of the observations that it expects.
        network: from observations to actions.
    """

    def __init__(self, card: ForeignCard, identity: str, network: Mlp, path: Path) -> None:
        """A policy of a network; `path` is for the error if the card has other observations."""
        self.card = card
        self.id = identity
        self.network = network
        self.observation_spec = observation_spec(path, card, len(network.layers[0][0]))

    @classmethod
    def load(cls, path: Path) -> Sb3Policy:
        """The policy stored in a file.

        Raises:
            InputError: if the file is no policy of a known architecture.
        """
        with opening(path):
            content = read_policy_file(path)
            data, tensors = _read(path, content)
            family = _family(path, data)
            card = parse_card(path, json.dumps(data.get(CARD_KEY, {})), ForeignCard)
            known = {
                "algorithm": f"SB3 {family.algorithm}",
                "step": _whole(data.get("_n_updates")),
                "transitions": _whole(data.get("num_timesteps")),
                "seed": _whole(data.get("seed")),
            }
            missing = {name: value for name, value in known.items() if getattr(card, name) is None}
            network = Mlp(_layers(path, family, tensors), _hidden(path, family, data), family.output)
            return cls(card.model_copy(update=missing), content_id(content), network, path)

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for observations (n, observation_spec.size) float32; memory as it was."""
        return self.network(observations), memory


def _whole(value: Any) -> int | None:
    return value if type(value) is int and 0 <= value <= MOST_COUNT else None


def _read(path: Path, content: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """The values of `data` and the tensors of `policy.pth`."""
    try:
        members = unpack(content, ("data", "policy.pth"))
    except zipfile.BadZipFile as error:
        raise InputError(f"{path}: not a whole .zip of Stable-Baselines3 ({error})") from None
    for name in ("data", "policy.pth"):
        if name not in members:
            raise InputError(f"{path}: no member {name!r}, expected a .zip of Stable-Baselines3")
    data = _settings(path, members["data"])
    need("torch", "sb3", f"{path}: a .zip of Stable-Baselines3")
    try:
        return data, read_state_dict(members["policy.pth"])
    except ValueError as error:
        raise InputError(f"{path}: member 'policy.pth' is not a file of weights ({error})") from None


def _settings(path: Path, content: bytes) -> dict[str, Any]:
    if len(content) > MOST_SETTINGS:
        raise InputError(f"{path}: member 'data' has {len(content)} bytes, expected at most {MOST_SETTINGS}")
    try:
        data = parse_json(content.decode())
    except ValueError as error:
        raise InputError(f"{path}: member 'data' is not valid JSON ({error})") from None
    if not isinstance(data, dict):
        raise InputError(f"{path}: member 'data' is no JSON object, expected that of Stable-Baselines3")
    return data


def _family(path: Path, data: Mapping[str, Any]) -> _Family:
    policy_class, space = (_section(data, name) for name in ("policy_class", "action_space"))
    module = str(policy_class.get("__module__"))
    if module not in _FAMILIES:
        raise InputError(
            f"{path}: policy class of {module!r}, expected MlpPolicy of SAC, TQC, TD3, DDPG, PPO or A2C"
        )
    bounds = (space.get("low"), space.get("high"))
    if bounds != ("[-1. -1.]", "[1. 1.]"):
        raise InputError(f"{path}: action space from {bounds[0]} to {bounds[1]}, expected two from -1 to 1")
    return _FAMILIES[module]


def _section(data: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    value = data.get(name)
    return value if isinstance(value, dict) else {}


def _hidden(path: Path, family: _Family, data: Mapping[str, Any]) -> Literal["relu", "tanh"]:
    settings = _section(data, "policy_kwargs")
    for setting in _UNSEEN:
        if settings.get(setting):
            raise InputError(f"{path}: policy_kwargs sets {setting}, expected MlpPolicy without it")
    activation = settings.get("activation_fn")
    if activation is None:
        return family.hidden
    name = str(activation)
    if name not in _ACTIVATIONS:
        raise InputError(f"{path}: activation_fn is {name}, expected ReLU or Tanh of torch.nn")
    return _ACTIVATIONS[name]


def _layers(path: Path, family: _Family, tensors: Mapping[str, Any]) -> tuple[tuple[Batch, Batch], ...]:
    numbered = (f"{family.body}.{index}" for index in count(step=2))
    names = [*takewhile(lambda name: f"{name}.weight" in tensors, numbered), *family.head]
    used = {f"{name}.{part}" for name in names for part in ("weight", "bias")}
    for name in tensors:
        if name not in used and not str(name).startswith(_NOT_DRIVING):
            raise InputError(f"{path}: tensor {name!r} is not one of the actor of an MlpPolicy")
    layers: list[tuple[Batch, Batch]] = []
    for name in names:
        weight, bias = (_tensor(path, f"{name}.{part}", tensors) for part in ("weight", "bias"))
        inputs = len(layers[-1][1]) if layers else weight.shape[-1]
        outputs = ACTION_SIZE if name == names[-1] else len(bias)
        if weight.shape != (outputs, inputs) or bias.shape != (outputs,):
            raise InputError(
                f"{path}: layer {name!r} has shapes {weight.shape} and {bias.shape}, "
                f"expected {(outputs, inputs)} and {(outputs,)}"
            )
        layers.append((np.ascontiguousarray(weight.T), bias))
    if not layers:
        raise InputError(f"{path}: tensor '{family.body}.0.weight' is missing")
    return tuple(layers)


def _tensor(path: Path, name: str, tensors: Mapping[str, Any]) -> Batch:
    import torch

    tensor = tensors.get(name)
    if not isinstance(tensor, torch.Tensor) or tensor.dtype != torch.float32 or not tensor.ndim:
        raise InputError(f"{path}: tensor {name!r} is missing or not of float32")
    try:
        array = tensor.detach().numpy()
    except (RuntimeError, TypeError) as error:
        reason = str(error).partition("\n")[0]
        raise InputError(f"{path}: tensor {name!r} is no plain array ({reason})") from None
    if not np.isfinite(array).all():
        raise InputError(f"{path}: tensor {name!r} holds numbers that are not finite")
    return array

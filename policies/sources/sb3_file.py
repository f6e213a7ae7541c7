"""What Stable-Baselines3 saved: the weights of a `.zip` and the settings beside them, read as data.

Of the archive's members two are read: `policy.pth`, by torch with `weights_only`, and the plain values of
`data`, a JSON object. What is pickled in `data` stays as it is. The weights do not show which functions stand
between the layers, but Stable-Baselines3 writes the settings that tell as plain text beside the pickles
(`stable_baselines3.common.save_util.data_to_json`).
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import count, takewhile
from pathlib import Path
from typing import Any, Literal

import numpy as np

from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import opening, read_policy_file
from nathlon.policies.sources.archive import unpack
from nathlon.policies.sources.foreign import ForeignCard
from nathlon.policies.sources.state_dict import read_state_dict
from nathlon.policies.strict_json import parse_json
from nathlon.policies.weights import CARD_KEY, MOST_COUNT, parse_card
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need

MOST_SETTINGS = 1 << 25
"""Bytes of `data`, with the last observations of all environments in it."""


@dataclass(frozen=True)
class Family:
    """The networks of one policy class.

    Attributes:
        algorithm: which trains it.
        body: prefix of the layers, whose numbers are even.
        head: name of the last layer where it stands apart from the body.
        hidden: function of the hidden layers, unless the settings name another one.
        squashes: whether tanh follows the last layer.
    """

    algorithm: str
    body: str
    head: tuple[str, ...]
    hidden: Literal["relu", "tanh"]
    squashes: bool


ACTORS = {
    "stable_baselines3.sac.policies": Family("SAC", "actor.latent_pi", ("actor.mu",), "relu", True),
    "sb3_contrib.tqc.policies": Family("TQC", "actor.latent_pi", ("actor.mu",), "relu", True),
    "stable_baselines3.td3.policies": Family("TD3 or DDPG", "actor.mu", (), "relu", True),
    "stable_baselines3.common.policies": Family(
        "PPO or A2C", "mlp_extractor.policy_net", ("action_net",), "tanh", False
    ),
}
"""Those of `MlpPolicy` that act by themselves, by the module of the policy class."""

ON_POLICY = ("stable_baselines3.common.policies", "sb3_contrib.common.recurrent.policies")
"""Modules of policy classes that learn from what they have just seen."""

_ACTIVATIONS: dict[str, Literal["relu", "tanh"]] = {
    "<class 'torch.nn.modules.activation.ReLU'>": "relu",
    "<class 'torch.nn.modules.activation.Tanh'>": "tanh",
}
_UNSEEN = ("features_extractor_class", "squash_output", "lstm_kwargs")
"""Settings that change what a network does, but not its weights."""
_NOT_ACTING = (
    "critic.",
    "critic_target.",
    "actor_target.",
    "value_net.",
    "mlp_extractor.value_net.",
    "log_std",
    "actor.log_std",
)
"""Prefixes of tensors that have no part in the action without noise."""


@dataclass(frozen=True)
class Sb3File:
    """A `.zip` of Stable-Baselines3 or sb3-contrib.

    All methods raise an InputError for what is not there or not as expected.

    Attributes:
        path: the file, for errors.
        data: the values of its member `data`.
        tensors: those of its member `policy.pth`, by name.
    """

    path: Path
    data: Mapping[str, Any]
    tensors: Mapping[str, Any]

    @classmethod
    def read(cls, path: Path, content: bytes) -> Sb3File:
        """The file with these bytes."""
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
            return cls(path, data, read_state_dict(members["policy.pth"]))
        except ValueError as error:
            raise InputError(f"{path}: member 'policy.pth' is not a file of weights ({error})") from None

    def section(self, name: str) -> Mapping[str, Any]:
        """An object in `data`; an empty one if it is none."""
        value = self.data.get(name)
        return value if isinstance(value, dict) else {}

    def family(self, families: Mapping[str, Family], expected: str) -> Family:
        """The one of `families` that the policy class belongs to; `expected` names them all."""
        module = str(self.section("policy_class").get("__module__"))
        if module not in families:
            raise InputError(f"{self.path}: policy class of {module!r}, expected {expected}")
        return families[module]

    def card(self, family: Family) -> ForeignCard:
        """The card that the model was given, with what else the file tells."""
        card = parse_card(self.path, json.dumps(self.data.get(CARD_KEY, {})), ForeignCard)
        known = {
            "algorithm": f"SB3 {family.algorithm}",
            "step": _whole(self.data.get("_n_updates")),
            "transitions": _whole(self.data.get("num_timesteps")),
            "seed": _whole(self.data.get("seed")),
        }
        missing = {name: value for name, value in known.items() if getattr(card, name) is None}
        return card.model_copy(update=missing)

    def hidden(self, family: Family) -> Literal["relu", "tanh"]:
        """The function of the hidden layers."""
        settings = self.section("policy_kwargs")
        for setting in _UNSEEN:
            if settings.get(setting):
                raise InputError(f"{self.path}: policy_kwargs sets {setting}, expected MlpPolicy without it")
        activation = settings.get("activation_fn")
        if activation is None:
            return family.hidden
        name = str(activation)
        if name not in _ACTIVATIONS:
            raise InputError(f"{self.path}: activation_fn is {name}, expected ReLU or Tanh of torch.nn")
        return _ACTIVATIONS[name]

    def layers(
        self, family: Family, outputs: int | None = None, others: Collection[str] = ()
    ) -> tuple[tuple[Batch, Batch], ...]:
        """Weight (inputs, outputs) and bias (outputs,) of each layer, float32 and finite.

        Args:
            family: whose layers.
            outputs: that the last layer must have.
            others: prefixes of further tensors that there may be; any other one is refused.
        """
        numbered = (f"{family.body}.{index}" for index in count(step=2))
        names = [*takewhile(lambda name: f"{name}.weight" in self.tensors, numbered), *family.head]
        used = {f"{name}.{part}" for name in names for part in ("weight", "bias")}
        for name in self.tensors:
            if name not in used and not name.startswith((*_NOT_ACTING, *others)):
                raise InputError(f"{self.path}: tensor {name!r} is not one of the actor of an MlpPolicy")
        layers: list[tuple[Batch, Batch]] = []
        for name in names:
            weight, bias = (self.tensor(f"{name}.{part}") for part in ("weight", "bias"))
            inputs = len(layers[-1][1]) if layers else weight.shape[-1]
            width = outputs if outputs and name == names[-1] else len(bias)
            if weight.shape != (width, inputs) or bias.shape != (width,):
                raise InputError(
                    f"{self.path}: layer {name!r} has shapes {weight.shape} and {bias.shape}, "
                    f"expected {(width, inputs)} and {(width,)}"
                )
            layers.append((np.ascontiguousarray(weight.T), bias))
        if not layers:
            raise InputError(f"{self.path}: tensor '{family.body}.0.weight' is missing")
        return tuple(layers)

    def tensor(self, name: str) -> Batch:
        """A tensor of one or more dimensions, float32 and finite."""
        import torch

        tensor = self.tensors.get(name)
        if not isinstance(tensor, torch.Tensor) or tensor.dtype != torch.float32 or not tensor.ndim:
            raise InputError(f"{self.path}: tensor {name!r} is missing or not of float32")
        try:
            array = tensor.detach().numpy()
        except (RuntimeError, TypeError) as error:
            reason = str(error).partition("\n")[0]
            raise InputError(f"{self.path}: tensor {name!r} is no plain array ({reason})") from None
        if not np.isfinite(array).all():
            raise InputError(f"{self.path}: tensor {name!r} holds numbers that are not finite")
        return array


def was_normalised(path: Path) -> bool:
    """Whether a `.zip` shows that `VecNormalize` was used: of observations, of rewards or of both.

    Algorithms on policy keep the observations before it, which they have for no other reason.

    Raises:
        InputError: if it is no `.zip` of Stable-Baselines3.
    """
    with opening(path):
        try:
            members = unpack(read_policy_file(path), ("data",))
        except zipfile.BadZipFile as error:
            raise InputError(f"{path}: not a whole .zip of Stable-Baselines3 ({error})") from None
        data = _settings(path, members["data"])
    module = str(Sb3File(path, data, {}).section("policy_class").get("__module__"))
    return module in ON_POLICY and data.get("_last_original_obs") is not None


def _whole(value: Any) -> int | None:
    return value if type(value) is int and 0 <= value <= MOST_COUNT else None


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

"""What Stable-Baselines3 saved: the weights of a `.zip` and the settings beside them, read as data.

Of the archive's members two are read: `policy.pth`, by torch with `weights_only`, and the values of `data`,
a JSON object: plain ones, and pickled spaces as `nathlon.policies.sources.inert_pickle` does. The weights do
not show which functions stand between the layers, but Stable-Baselines3 writes the settings that tell as
plain text beside the pickles (`stable_baselines3.common.save_util.data_to_json`).
"""

from __future__ import annotations

import base64
import json
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import opening, read_policy_file
from nathlon.policies.sources.archive import unpack
from nathlon.policies.sources.foreign import ForeignCard
from nathlon.policies.sources.inert_pickle import read_pickle
from nathlon.policies.sources.state_dict import read_state_dict
from nathlon.policies.strict_json import parse_json
from nathlon.policies.weights import CARD_KEY, MOST_COUNT, parse_card
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need

if TYPE_CHECKING:
    from gymnasium import spaces

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
        within: prefix of the module that acts, in which the extractor of features is too.
    """

    algorithm: str
    body: str
    head: tuple[str, ...]
    hidden: Literal["relu", "tanh"]
    squashes: bool
    within: str = ""


FAMILIES = {
    "stable_baselines3.sac.policies": Family("SAC", "actor.latent_pi", ("actor.mu",), "relu", True, "actor."),
    "sb3_contrib.tqc.policies": Family("TQC", "actor.latent_pi", ("actor.mu",), "relu", True, "actor."),
    "sb3_contrib.crossq.policies": Family("CrossQ", "actor.latent_pi", ("actor.mu",), "relu", True, "actor."),
    "stable_baselines3.td3.policies": Family("TD3 or DDPG", "actor.mu", (), "relu", True, "actor."),
    "stable_baselines3.common.policies": Family(
        "PPO or A2C", "mlp_extractor.policy_net", ("action_net",), "tanh", False
    ),
    "sb3_contrib.common.maskable.policies": Family(
        "MaskablePPO", "mlp_extractor.policy_net", ("action_net",), "tanh", False
    ),
    "sb3_contrib.common.recurrent.policies": Family(
        "RecurrentPPO", "mlp_extractor.policy_net", ("action_net",), "tanh", False
    ),
    "sb3_contrib.ars.policies": Family("ARS", "action_net", (), "relu", False),
    "stable_baselines3.dqn.policies": Family("DQN", "q_net.q_net", (), "relu", False, "q_net."),
    "sb3_contrib.qrdqn.policies": Family(
        "QR-DQN", "quantile_net.quantile_net", (), "relu", False, "quantile_net."
    ),
}
"""Those of policies that come with the libraries, by the module of the policy class."""
VALUES = ("DQN", "QR-DQN")
"""Algorithms whose networks tell what choices are worth."""

ON_POLICY = (
    "stable_baselines3.common.policies",
    "sb3_contrib.common.maskable.policies",
    "sb3_contrib.common.recurrent.policies",
)
"""Modules of policy classes that learn from what they have just seen."""

_ACTIVATIONS: dict[str, Literal["relu", "tanh"]] = {
    "<class 'torch.nn.modules.activation.ReLU'>": "relu",
    "<class 'torch.nn.modules.activation.Tanh'>": "tanh",
}
_EXTRACTORS = ("FlattenExtractor", "NatureCNN", "CombinedExtractor")
_OF_TORCH_LAYERS = "stable_baselines3.common.torch_layers."
"""Where those classes are that make features of observations."""
_NOT_ACTING = (
    "critic.",
    "critic_target.",
    "actor_target.",
    "value_net.",
    "mlp_extractor.value_net.",
    "vf_features_extractor.",
    "lstm_critic.",
    "q_net_target.",
    "quantile_net_target.",
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
    _read: set[str] = field(default_factory=set)

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

    def space(self, name: str) -> spaces.Space[Any] | None:
        """A space in `data`, of the pickle there, read as data; None where it cannot be read."""
        from nathlon.policies.sources.pickled_space import space_of  # gymnasium takes long to load

        try:
            content = base64.b64decode(str(self.section(name)[":serialized:"]), validate=True)
            return space_of(read_pickle(content))
        except (KeyError, ValueError):
            return None

    @property
    def family(self) -> Family:
        """The one that the policy class belongs to."""
        module = str(self.section("policy_class").get("__module__"))
        if module not in FAMILIES:
            known = ", ".join(family.algorithm for family in FAMILIES.values())
            raise InputError(
                f"{self.path}: policy class of {module!r}, expected one of {known}; for a class of your "
                "own export ONNX, or name a loader in the world's mapping"
            )
        return FAMILIES[module]

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
        extractor = str(settings.get("features_extractor_class") or _EXTRACTORS[0])
        name = extractor.removeprefix(f"<class '{_OF_TORCH_LAYERS}").removesuffix("'>")
        if name not in _EXTRACTORS:
            raise InputError(
                f"{self.path}: policy_kwargs sets features_extractor_class {name!r}, expected one of "
                f"{', '.join(_EXTRACTORS)}; for your own export ONNX, or name a loader in the world's mapping"
            )
        if settings.get("lstm_kwargs"):
            raise InputError(f"{self.path}: policy_kwargs sets lstm_kwargs, expected an LSTM without them")
        activation = settings.get("activation_fn")
        if activation is None:
            return family.hidden
        name = str(activation)
        if name not in _ACTIVATIONS:
            raise InputError(f"{self.path}: activation_fn is {name}, expected ReLU or Tanh of torch.nn")
        return _ACTIVATIONS[name]

    def squashes(self, family: Family) -> bool:
        """Whether tanh follows the last layer."""
        if family.algorithm != "ARS":
            return family.squashes or self.setting("squash_output", 0.0) > 0.0
        # Both of its classes are in one module; the one of a linear policy has no method of its own.
        linear = "forward" not in self.section("policy_class")
        return self.setting("squash_output", 0.0 if linear else 1.0) > 0.0

    def setting(self, name: str, default: float) -> float:
        """A number in `policy_kwargs`, where truth is 1."""
        value = self.section("policy_kwargs").get(name, default)
        try:
            return float({"True": 1.0, "False": 0.0}.get(str(value), value))
        except (TypeError, ValueError):
            raise InputError(f"{self.path}: policy_kwargs has {name} {value!r}, expected a number") from None

    def mean_bound(self, family: Family) -> float | None:
        """Within which the last layer's sums are kept before tanh, as of state-dependent noise (gSDE)."""
        if family.head and f"{family.head[-1]}.0.weight" in self.tensors:
            return self.setting("clip_mean", 2.0)
        return None

    def layers(self, family: Family, outputs: int | None = None) -> tuple[tuple[Batch, Batch], ...]:
        """Weight (inputs, outputs) and bias (outputs,) of each layer, float32 and finite.

        What normalises the inputs of a layer, as in CrossQ, is part of it.

        Args:
            family: whose layers.
            outputs: that the last layer must have.
        """
        layers: list[tuple[Batch, Batch]] = []
        scale: tuple[Batch, Batch] | None = None
        names = self._names(family)
        for name in names:
            if f"{name}.ra_mean" in self.tensors:
                scale = self._renormed(name)
                continue
            weight = self.tensor(f"{name}.weight")
            bare = family.algorithm == "ARS" and f"{name}.bias" not in self.tensors
            bias = np.zeros(len(weight), np.float32) if bare else self.tensor(f"{name}.bias")
            inputs = len(layers[-1][1]) if layers else weight.shape[-1]
            width = outputs if outputs and name == names[-1] else len(bias)
            if weight.shape != (width, inputs) or bias.shape != (width,):
                raise InputError(
                    f"{self.path}: layer {name!r} has shapes {weight.shape} and {bias.shape}, "
                    f"expected {(width, inputs)} and {(width,)}"
                )
            if scale:
                if scale[0].shape != (inputs,):
                    raise InputError(
                        f"{self.path}: layer {name!r} takes {inputs} numbers, not those before it"
                    )
                weight, bias, scale = weight * scale[0], bias + weight @ scale[1], None
            layers.append((np.ascontiguousarray(weight.T), bias))
        if not layers:
            raise InputError(f"{self.path}: tensor '{family.body}.0.weight' is missing")
        return tuple(layers)

    def _names(self, family: Family) -> list[str]:
        """Of the layers in turn."""
        numbers = sorted(
            {int(n) for name in self.tensors if (n := _number_of(name, family.body)) is not None}
        )
        head = [f"{name}.0" if f"{name}.0.weight" in self.tensors else name for name in family.head]
        return [*(f"{family.body}.{number}" for number in numbers), *head]

    def _renormed(self, name: str) -> tuple[Batch, Batch]:
        """Factor and shift of a layer that normalises by running statistics."""
        parts = ("ra_mean", "ra_var", "scale", "bias")
        mean, variance, scale, bias = (self.tensor(f"{name}.{part}") for part in parts)
        self._read.add(f"{name}.steps")
        if len({part.shape for part in (mean, variance, scale, bias)}) > 1 or mean.ndim != 1:
            raise InputError(f"{self.path}: layer {name!r} has statistics of several shapes")
        with np.errstate(invalid="ignore", divide="ignore"):
            factor = scale / np.sqrt(variance + np.float32(self.setting("batch_norm_eps", 0.001)))
        if not np.isfinite(factor).all():
            raise InputError(f"{self.path}: layer {name!r} has a variance that is not positive")
        return factor, bias - mean * factor

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
        self._read.add(name)
        return array

    def features(self, family: Family) -> str:
        """Prefix of the tensors that make features of observations; the critic may have the same."""
        own = f"{family.within}pi_features_extractor."
        return (
            own
            if any(name.startswith(own) for name in self.tensors)
            else f"{family.within}features_extractor."
        )

    def check_all_read(self, family: Family) -> None:
        """See that no tensor that has part in the action has been passed over."""
        shared = ("features_extractor.",) if self.features(family).startswith("pi_") else ()
        for name in self.tensors:
            if name not in self._read and not name.startswith((*_NOT_ACTING, *shared)):
                raise InputError(f"{self.path}: tensor {name!r} is not one of the actor of a known policy")


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


def _number_of(name: str, body: str) -> str | None:
    """Of the layer in a body that a tensor belongs to."""
    found = re.fullmatch(re.escape(body) + r"\.(\d{1,4})\.\w+", name)
    return found and found[1]


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

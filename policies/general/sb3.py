"""Policies that Stable-Baselines3 or sb3-contrib saved, of any environment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import count, takewhile
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Space

from nathlon.policies.general.lstm import Lstm
from nathlon.policies.general.outputs import Outputs
from nathlon.policies.general.policy import GeneralPolicy, Memoryless, Network
from nathlon.policies.general.sb3_observations import Observed, observed_by
from nathlon.policies.general.wrapped import Wrapped
from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import opening, read_policy_file
from nathlon.policies.sources.foreign import ForeignCard
from nathlon.policies.sources.normalisation import companions, identity_with
from nathlon.policies.sources.sb3_file import VALUES, Family, Sb3File
from nathlon.policies.sources.vec_normalize import Statistics
from nathlon.policies.sources.zoo_settings import ZooSettings, made_with
from nathlon.sim.errors import InputError

_SPACES: tuple[str, ...] = ("Box", "Discrete", "MultiDiscrete")


@dataclass(frozen=True)
class Sb3Model:
    """What a `.zip` holds, with what lies beside it.

    Attributes:
        id: SHA-256 of the file, or of all files.
        card: what is known of the policy.
        mlp: the network, if it is a perceptron that sees observations as they are; else None.
        network: what maps flat observations to numbers.
        observed: how observations are seen.
        outputs: what the numbers mean.
        wrappers: classes that the environment was wrapped in.
        made_with: arguments that it was made with.
    """

    id: str
    card: ForeignCard
    mlp: Mlp | None
    network: Network
    observed: Observed
    outputs: Outputs
    wrappers: tuple[str, ...]
    made_with: Mapping[str, Any]

    @classmethod
    def read(cls, path: Path, seen: Space[Any] | None = None) -> Sb3Model:
        """The model in a file.

        Args:
            path: the file.
            seen: space of the observations that it will get; None where they are one row of numbers.

        Raises:
            InputError: if the file is no policy of a known architecture, or what lies beside it is not as
                expected or not for this space.
        """
        with opening(path):
            content, beside = read_policy_file(path), companions(path)
            contents = beside.read()
            statistics = Statistics.read(beside.statistics, contents[0]) if beside.statistics else None
            settings = ZooSettings.read(beside.settings, contents[1]) if beside.settings else None
            if settings and settings.normalised and statistics is None:
                raise InputError(
                    f"{path}: its settings {settings.path.name!r} say that observations were normalised, "
                    "expected the statistics as vecnormalize.pkl beside these"
                )
            file = Sb3File.read(path, content)
            family = file.family
            observed = observed_by(file, family, seen, settings.frames if settings else 1, statistics)
            kind = _kind_of_action(file, family)
            mlp, network = _network(file, family, observed, kind)
            actions = len((mlp or _head(network)).layers[-1][1])
            outputs = _outputs(file, family, kind, actions)
            file.check_all_read(family)
            plain = mlp if mlp and observed.plain and isinstance(network, Memoryless) else None
            return cls(
                identity_with(content, contents),
                file.card(family),
                plain if file.mean_bound(family) is None else None,
                network if observed.plain else Wrapped(observed.parts, network),
                observed,
                outputs,
                settings.wrappers if settings else (),
                made_with(beside.arguments, contents[-1]) if beside.arguments else {},
            )


def load_sb3(path: Path, seen: Space[Any] | None = None) -> GeneralPolicy:
    """The policy stored in a `.zip`, for a space of observations; see `Sb3Model.read`."""
    model = Sb3Model.read(path, seen)
    return GeneralPolicy(
        source=str(path),
        id=model.id,
        algorithm=model.card.algorithm,
        step=model.card.step,
        seed=model.card.seed,
        observation_size=model.observed.size,
        network=model.network,
        outputs=model.outputs,
        observation_shape=model.observed.shape,
        wrappers=model.wrappers,
        made_with=model.made_with,
        precise=any(part.normal for part in model.observed.parts),
    )


def _head(network: Network) -> Mlp:
    assert isinstance(network, Lstm)
    return network.head


def _network(file: Sb3File, family: Family, observed: Observed, kind: str) -> tuple[Mlp | None, Network]:
    """The network of features: as a perceptron if it is one, and what runs it."""
    layers = file.layers(family)
    if family.algorithm == "QR-DQN":
        layers = (*layers[:-1], _averaged(file, layers[-1]))
    squashes = kind == "Box" and file.squashes(family)
    mlp = Mlp(layers, file.hidden(family), "tanh" if squashes else "linear")
    size = len(layers[0][0])
    if family.algorithm == "RecurrentPPO":
        lstm = Lstm(_lstm_layers(file, size), mlp)
        _check_features(file, len(lstm.layers[0][0]), observed)
        return None, lstm
    _check_features(file, size, observed)
    bound = file.mean_bound(family)
    if bound is None or bound <= 0.0:
        return mlp, Memoryless(mlp)
    sums = replace(mlp, output="linear")
    return mlp, Memoryless(lambda seen: np.tanh(np.clip(sums(seen), -np.float32(bound), np.float32(bound))))


def _check_features(file: Sb3File, size: int, observed: Observed) -> None:
    if size != observed.features:
        raise InputError(
            f"{file.path}: takes {size} numbers, but its observation space has {observed.features}, "
            "expected layers that fit it"
        )


def _averaged(file: Sb3File, layer: tuple[Batch, Batch]) -> tuple[Batch, Batch]:
    """The last layer of a network of quantiles, which gives their means."""
    weight, bias = layer
    quantiles = int(file.setting("n_quantiles", 200))
    if quantiles < 1 or len(bias) % quantiles:
        raise InputError(f"{file.path}: gives {len(bias)} numbers, expected {quantiles} for each choice")
    means = weight.reshape(len(weight), quantiles, -1).mean(axis=1), bias.reshape(quantiles, -1).mean(axis=0)
    return np.ascontiguousarray(means[0]), means[1]


def _lstm_layers(file: Sb3File, units: int) -> tuple[Any, ...]:
    """Layers of the actor's LSTM, of so many units each."""
    indices = takewhile(lambda i: f"lstm_actor.weight_ih_l{i}" in file.tensors, count())
    layers: list[tuple[Batch, ...]] = []
    for index in indices:
        names = [f"lstm_actor.{part}_{kind}_l{index}" for part in ("weight", "bias") for kind in ("ih", "hh")]
        tensors = [file.tensor(name) for name in names]
        inputs = units if layers else tensors[0].shape[-1]
        shapes = [(4 * units, inputs), (4 * units, units), (4 * units,), (4 * units,)]
        for name, tensor, shape in zip(names, tensors, shapes, strict=True):
            if tensor.shape != shape:
                raise InputError(f"{file.path}: tensor {name!r} has shape {tensor.shape}, expected {shape}")
        weight, own, *biases = tensors
        layers.append((weight.T.copy(), own.T.copy(), biases[0] + biases[1]))
    if not layers:
        raise InputError(f"{file.path}: tensor 'lstm_actor.weight_ih_l0' is missing")
    return tuple(layers)


def _kind_of_action(file: Sb3File, family: Family) -> str:
    """The kind of action space that a model was trained for."""
    space = file.space("action_space")
    # As "<class 'gymnasium.spaces.box.Box'>".
    told = str(file.section("action_space").get(":type:")).rstrip("'>").rpartition(".")[2]
    kind = type(space).__name__ if space else told
    if family.squashes:
        allowed = _SPACES[:1]
    elif family.algorithm in VALUES:
        allowed = _SPACES[1:2]
    else:
        allowed = _SPACES[:2] if family.algorithm == "ARS" else _SPACES
    if kind not in allowed:
        raise InputError(f"{file.path}: action space is {kind}, expected {' or '.join(allowed)}")
    return kind


def _outputs(file: Sb3File, family: Family, kind: str, actions: int) -> Outputs:
    told, space = file.section("action_space"), file.space("action_space")
    attributes = {"Box": "low high", "MultiDiscrete": "nvec", "Discrete": "n"}
    names = attributes[kind].split()
    # Those of the pickle, for texts depend on how the program printed that saved them.
    values = {name: getattr(space, name) if space else told.get(name) for name in names}
    texts = {name: " ".join(str(value).split()) for name, value in values.items()}
    if kind != "Box":
        return Outputs(None, "argmax", actions, texts, masked=family.algorithm == "MaskablePPO")
    return Outputs("unscale" if file.squashes(family) else "clip", None, actions, texts)

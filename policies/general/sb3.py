"""Policies that Stable-Baselines3 or sb3-contrib saved, of any environment with flat observations."""

from __future__ import annotations

from itertools import count, takewhile
from pathlib import Path
from typing import Any

from nathlon.policies.general.lstm import Lstm
from nathlon.policies.general.outputs import Outputs
from nathlon.policies.general.policy import GeneralPolicy, Memoryless, Network
from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import content_id, opening, read_policy_file
from nathlon.policies.sources.sb3_file import ACTORS, Family, Sb3File
from nathlon.sim.errors import InputError

_RECURRENT = Family("RecurrentPPO", "mlp_extractor.policy_net", ("action_net",), "tanh", False)
_VALUES = Family("DQN", "q_net.q_net", (), "relu", False)
_FAMILIES = {
    **ACTORS,
    "stable_baselines3.dqn.policies": _VALUES,
    "sb3_contrib.common.recurrent.policies": _RECURRENT,
}
_EXPECTED = "MlpPolicy of SAC, TQC, TD3, DDPG, PPO, A2C or DQN, or MlpLstmPolicy of RecurrentPPO"
_SPACES = ("Box", "Discrete", "MultiDiscrete")


def load_sb3(path: Path) -> GeneralPolicy:
    """The policy stored in a `.zip`.

    Raises:
        InputError: if the file is no policy of a known architecture.
    """
    with opening(path):
        content = read_policy_file(path)
        file = Sb3File.read(path, content)
        family = file.family(_FAMILIES, _EXPECTED)
        _check_observations(file)
        card = file.card(family)
        network, size, actions = _network(file, family)
        return GeneralPolicy(
            source=str(path),
            id=content_id(content),
            algorithm=card.algorithm,
            step=card.step,
            seed=card.seed,
            observation_size=size,
            network=network,
            outputs=_outputs(file, family, actions),
            observation_shape=_shape(file),
        )


def _shape(file: Sb3File) -> tuple[int, ...] | None:
    match file.section("observation_space").get("_shape"):
        case [*sizes] if sizes and all(type(size) is int for size in sizes):
            return tuple(sizes)
    return None


def _check_observations(file: Sb3File) -> None:
    space = file.section("observation_space")
    shape = space.get("_shape")
    # Those are divided by 255 and may be turned before the network sees them.
    if space.get("dtype") == "uint8" and isinstance(shape, list) and len(shape) == 3:
        raise InputError(f"{file.path}: observation space of images, expected flat observations")


def _network(file: Sb3File, family: Family) -> tuple[Network, int, int]:
    """The network, and the numbers that it takes and gives."""
    memory = ("lstm_actor.", "lstm_critic.") if family is _RECURRENT else ()
    ignored = ("q_net_target.",) if family is _VALUES else ()
    layers = file.layers(family, others=(*memory, *ignored))
    mlp = Mlp(layers, file.hidden(family), "tanh" if family.squashes else "linear")
    size, actions = len(layers[0][0]), len(layers[-1][1])
    if not memory:
        return Memoryless(mlp), size, actions
    lstm = Lstm(_lstm_layers(file, size), mlp)
    return lstm, len(lstm.layers[0][0]), actions


def _lstm_layers(file: Sb3File, units: int) -> tuple[Any, ...]:
    """Layers of the actor's LSTM, of so many units each."""
    indices = takewhile(lambda i: f"lstm_actor.weight_ih_l{i}" in file.tensors, count())
    layers: list[tuple[Batch, ...]] = []
    used: set[str] = set()
    for index in indices:
        names = [f"lstm_actor.{part}_{kind}_l{index}" for part in ("weight", "bias") for kind in ("ih", "hh")]
        used.update(names)
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
    for name in file.tensors:
        if name.startswith("lstm_actor.") and name not in used:
            raise InputError(f"{file.path}: tensor {name!r} is not one of an LSTM's")
    return tuple(layers)


def _outputs(file: Sb3File, family: Family, actions: int) -> Outputs:
    space = file.section("action_space")
    # As "<class 'gymnasium.spaces.box.Box'>".
    kind = str(space.get(":type:")).rstrip("'>").rpartition(".")[2]
    allowed = _SPACES[:1] if family.squashes else _SPACES[1:2] if family is _VALUES else _SPACES
    if kind not in allowed:
        raise InputError(f"{file.path}: action space is {kind}, expected {' or '.join(allowed)}")
    names = {"Box": ("low", "high"), "MultiDiscrete": ("nvec",), "Discrete": ("n",)}[kind]
    texts = {name: " ".join(str(space.get(name)).split()) for name in names}
    if kind != "Box":
        return Outputs(None, "argmax", actions, texts)
    return Outputs("unscale" if family.squashes else "clip", None, actions, texts)

"""The learner that holds the state of QR-SAC and updates it."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import chain

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from nathlon.policies.qrsac.captured import CapturedUpdates, Inputs, Run
from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.memory import keep_freed_memory
from nathlon.policies.qrsac.recurrent import Network, RecurrentNetwork, act
from nathlon.policies.qrsac.update import Metrics, Minibatch, Noise, PassageUpdate, State, Update
from nathlon.policies.replay_buffer.passages import Observations
from nathlon.sim.errors import InputError

log = logging.getLogger(__name__)

NETWORKS = ("policy", "critic", "target", "average")


def fast_precision(device: torch.device) -> torch.dtype:
    """The float format in which the device multiplies matrices fastest: float32 or bfloat16."""
    if device.type == "cuda":
        fast = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        fast = bool(torch.cpu.get_capabilities().get("avx512_bf16"))
    return torch.bfloat16 if fast else torch.float32


def _compiled(update: Update) -> Run:
    if not any(map(shutil.which, ("g++", "c++", "clang++"))):
        log.warning("no C++ compiler found: QR-SAC runs uncompiled, at about half the speed")
        return update.in_place
    # This learner's graph is its own and depends on nothing but the shapes, so that nothing else is checked
    # before each update, which takes long beside a small one.
    return torch.compile(  # type: ignore[call-overload]
        update.in_place,
        fullgraph=True,
        dynamic=False,
        isolate_recompiles=True,
        options={"guard_filter_fn": torch.compiler.keep_tensor_guards_unsafe},
    )


class QRSAC:
    """Quantile-regression soft actor-critic for actions in [-1, 1]."""

    def __init__(
        self,
        observation_size: int,
        action_size: int,
        config: QRSACConfig,
        generator: torch.Generator,
        compiled: bool = True,
        updates: int | None = None,
        facts: int = 0,
        recurrent: RecurrentNetwork | None = None,
    ) -> None:
        """A learner with fresh networks on the generator's device.

        Args:
            observation_size: length of an observation, as the critics see it.
            action_size: length of an action.
            config: hyperparameters.
            generator: the source of all randomness, advanced by updates and stochastic actions.
            compiled: whether to compile the update, if a C++ compiler is found; the first update then takes
                half a minute and a batch must always have the same size.
            updates: of the whole run, after which rates and alpha have fallen to their final shares.
            facts: how many numbers of an observation, the last ones, the encoder takes.
            recurrent: the policy where it remembers, or does not see what its critics see; it learns from
                passages, and updates are not compiled.

        Raises:
            InputError: if there is an encoder and nothing to encode, or something is to fall and the updates
                of the run are not given.
        """
        if updates is None and min(config.final_rates, config.final_alpha) < 1.0:
            name = "final_rates" if config.final_rates < 1.0 else "final_alpha"
            raise InputError(f"QR-SAC: {name} is below 1, which needs the count of updates of the run")
        if config.encoder and not facts:
            raise InputError("QR-SAC: encoder is given, but nothing in the observation is the same all race")
        self.config = config
        self.action_size = action_size
        self._generator = generator
        precision = (
            fast_precision(generator.device)
            if config.precision == "auto"
            else getattr(torch, config.precision)
        )
        self.recurrent = recurrent
        if recurrent is None:
            self._update = Update(observation_size, action_size, config, precision, updates, facts)
        else:
            self._update = PassageUpdate(observation_size, action_size, config, recurrent, precision, updates)
        if generator.device.type == "cpu":
            keep_freed_memory()
        compiled = compiled and recurrent is None
        self._run: Run = _compiled(self._update) if compiled else self._update.in_place
        policy = self.policy_network.initial(generator)
        critic = self._update.critics.initial(generator)
        self._state = State(
            policy=policy,
            policy_mean=torch.zeros_like(policy),
            policy_square=torch.zeros_like(policy),
            critic=critic,
            critic_mean=torch.zeros_like(critic),
            critic_square=torch.zeros_like(critic),
            target=critic.clone(),
            average=policy.clone(),
        )
        self._made = 0
        self._graphs: dict[int, CapturedUpdates] = {}

    def update(self, batch: Minibatch) -> Metrics:
        """Learns from one batch.

        Returns:
            scalar tensors: critic_loss, policy_loss, mean_q (of the batch, before the update), entropy (of
            the policy, an estimate by its samples), gradient_norm (of both critics, before clipping).
        """
        return self.updates(lambda: batch, 1)

    def updates(self, sample: Callable[[], Minibatch], count: int) -> Metrics:
        """Learns from so many batches, on a CUDA device in one captured graph for each count.

        Args:
            sample: gives the next batch, which may overwrite the last.
            count: of updates.

        Returns:
            the metrics of the last, as `update`.
        """
        with torch.no_grad():
            inputs = (self._inputs(sample()) for _ in range(count))
            if self._generator.device.type == "cuda" and self.recurrent is None:
                return self._captured(count, inputs)
            for each in inputs:
                metrics = self._run(self._state, *each)
            return metrics

    def _captured(self, count: int, inputs: Iterator[Inputs]) -> Metrics:
        if count in self._graphs:
            return self._graphs[count](inputs)
        first = next(inputs)
        self._graphs[count] = CapturedUpdates(self._run, self._state, first, count)
        return self._graphs[count](chain((first,), inputs))

    def _inputs(self, batch: Minibatch) -> Inputs:
        device = self._generator.device
        pace = self._update.pace(self._made, device)
        self._made += 1
        return Inputs(pace, batch.to(device), self._noise(len(batch.reward)))

    def _noise(self, count: int) -> Noise:
        action, next_action = self._normal(count), self._normal(count)
        if self.config.dropout == 0.0:
            return Noise(action, next_action, None)
        seed = torch.empty(2, dtype=torch.int32, device=self._generator.device)
        return Noise(action, next_action, seed.random_(-(2**31), None, generator=self._generator))

    def _normal(self, count: int) -> Tensor:
        shape = (count, self.action_size)
        return torch.randn(shape, generator=self._generator, device=self._generator.device)

    @property
    def policy_network(self) -> Network:
        """The policy as a function of its parameters, in full precision."""
        if self.recurrent is not None:
            return self.recurrent
        return replace(self._update.policy, precision=torch.float32)

    @property
    def memory(self) -> int:
        """Numbers that the policy remembers; 0 for none."""
        return self.policy_network.memory

    @property
    def policy_parameters(self) -> Tensor:
        """Parameters (p,) of the policy on the CPU; later updates leave them as they are."""
        return self._state.policy.to("cpu", copy=True)

    @property
    def made(self) -> int:
        """Updates so far."""
        return self._made

    def act(self, observations: NDArray[np.float32], stochastic: bool) -> NDArray[np.float32]:
        """Actions (n, a) of the present policy drawn from the learner's generator, or of the mean policy."""
        return self.drive(observations, np.zeros((len(observations), 0), np.float32), stochastic)[0]

    def drive(
        self, seen: Observations, memory: NDArray[np.float32], stochastic: bool
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """As `act`, of a policy that may remember: actions (n, a), and memory (n, m) after them."""
        parameters = self._state.policy if stochastic else self._state.average
        return act(self.policy_network, parameters, seen, memory, self._generator if stochastic else None)

    def policy_tensors(self) -> dict[str, NDArray[np.float32]]:
        """The mean policy's weights (in, out) and biases (out,) by layer: `0.weight`, `0.bias`, `1.weight` ..

        The last layer gives the means, then the logarithms of the standard deviations. An encoder's are
        `encoder.0.weight` and so on.
        """
        if self.recurrent is not None:
            own = self.recurrent.tensors(self._state.average)
            return {name: tensor.cpu().numpy().copy() for name, tensor in own.items()}
        tensors = zip(self._names, self._update.policy.tensors(self._state.average), strict=True)
        return {
            name: (tensor[0] if name.endswith("bias") else tensor).cpu().numpy() for name, tensor in tensors
        }

    @property
    def _names(self) -> list[str]:
        """Of the policy's tensors, in their order in its parameters."""
        if self.recurrent is not None:
            return list(self.recurrent.shapes)
        policy = self._update.policy
        encoded, trunk = len(policy.encoder[1:]), len(policy.widths[1:])
        layers = [f"encoder.{i}" for i in range(encoded)] + [str(i) for i in range(trunk)]
        return [f"{layer}.{kind}" for layer in layers for kind in ("weight", "bias")]

    def state_dict(self) -> dict[str, Tensor]:
        """Copies of all that an exact resume needs, the generator's state included, as named tensors."""
        copies = {name: tensor.clone() for name, tensor in self._state._asdict().items()}
        made = torch.tensor(self._made, dtype=torch.float64)
        return {**copies, "step": made, "generator": self._generator.get_state()}

    def load_state_dict(self, tensors: dict[str, Tensor]) -> None:
        """Goes on from what `state_dict` of a learner of the same shape returned.

        Raises:
            InputError: naming the tensor that is missing, unknown or of another shape or type.
        """
        self._check(tensors, self.state_dict())
        try:
            self._generator.set_state(tensors["generator"].cpu())
        except RuntimeError as error:
            raise InputError(f"training state: tensor 'generator': {error}") from None
        self._take(tensors, State._fields)
        self._made = int(tensors["step"])

    def load_networks(self, tensors: dict[str, Tensor]) -> None:
        """Takes policy, critics and targets from what `state_dict` of a learner of the same shape returned.

        Adam's moments, the count of updates and the generator stay as they are.

        Raises:
            InputError: naming the tensor that is missing, unknown or of another shape or type.
        """
        state = self.state_dict()
        self._check(
            {name: tensors[name] for name in NETWORKS if name in tensors},
            {name: state[name] for name in NETWORKS},
        )
        self._take(tensors, NETWORKS)

    def load_policy(self, tensors: Mapping[str, NDArray[np.float32]]) -> None:
        """Takes a policy of the same shape, as `policy_tensors` gives it; all else stays as it is."""
        parameters = torch.cat([torch.from_numpy(tensors[name]).flatten() for name in self._names])
        self._take({"policy": parameters, "average": parameters}, ("policy", "average"))

    def _take(self, tensors: dict[str, Tensor], names: Iterable[str]) -> None:
        for name in names:
            getattr(self._state, name).copy_(tensors[name])

    def _check(self, tensors: dict[str, Tensor], expected: dict[str, Tensor]) -> None:
        if set(tensors) != set(expected):
            name = sorted(set(tensors) ^ set(expected))[0]
            raise InputError(
                f"training state: tensor {name!r} is {'missing' if name in expected else 'unknown'}"
            )
        for name, old in expected.items():
            new = tensors[name]
            if new.shape != old.shape or new.dtype != old.dtype:
                raise InputError(
                    f"training state: tensor {name!r} is {tuple(new.shape)} {new.dtype}, "
                    f"expected {tuple(old.shape)} {old.dtype}"
                )

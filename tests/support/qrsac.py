"""Small learners, batches and draws, for the tests of QR-SAC."""

from __future__ import annotations

import torch

from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.learner import QRSAC
from nathlon.policies.qrsac.update import Noise, State
from nathlon.policies.replay_buffer.table import Batch

OBSERVATION, ACTION, ROWS = 5, 2, 16


def config(**changes: object) -> QRSACConfig:
    values: dict[str, object] = {"hidden": (8, 12), "quantiles": 6, "critic_rate": 1e-2, "policy_rate": 1e-2}
    return QRSACConfig.model_validate(values | changes)


def learner(seed: int = 0, compiled: bool = False, updates: int | None = None, **changes: object) -> QRSAC:
    generator = torch.Generator().manual_seed(seed)
    return QRSAC(OBSERVATION, ACTION, config(**changes), generator, compiled, updates)


def state_of(qrsac: QRSAC) -> State:
    tensors = qrsac.state_dict()
    return State(*(tensors[name] for name in State._fields))


def batches(count: int, seed: int = 1) -> list[Batch]:
    random = torch.Generator().manual_seed(seed)
    return [
        Batch(
            observation=torch.randn(ROWS, OBSERVATION, generator=random),
            action=2.0 * torch.rand(ROWS, ACTION, generator=random) - 1.0,
            reward=3.0 * torch.randn(ROWS, generator=random),
            discount=torch.rand(ROWS, generator=random).round() * 0.9,
            next_observation=torch.randn(ROWS, OBSERVATION, generator=random),
        )
        for _ in range(count)
    ]


def noise_of(seed: int) -> Noise:
    random = torch.Generator().manual_seed(seed)
    action, next_action = torch.randn(2, ROWS, ACTION, generator=random)
    return Noise(action, next_action, torch.randint(2**31, (2,), dtype=torch.int32, generator=random))

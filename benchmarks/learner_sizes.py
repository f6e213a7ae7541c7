"""Sizes at which learners are timed, and a replay for them."""

from __future__ import annotations

import numpy as np

from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.replay_buffer.table import NStepReplay

OBSERVATION, ACTION = 231, 2
SIZES = {
    "256x2, batch 256": ((256, 256), 256),
    "256x2, batch 1,024": ((256, 256), 1024),
    "2,048x4, batch 1,024": ((2048,) * 4, 1024),
}
STORED = 20_000
SLOTS = 100
ALPHA = 0.01


def our_config(hidden: tuple[int, ...], batch: int, precision: str) -> QRSACConfig:
    """Ours at a size."""
    return QRSACConfig.model_validate(
        {"hidden": hidden, "batch": batch, "alpha": ALPHA, "precision": precision}
    )


def our_replay(rng: np.random.Generator) -> NStepReplay:
    """Our replay, full of noise."""
    replay = NStepReplay(STORED, SLOTS, OBSERVATION, ACTION, 1, 0.99)
    ended = np.zeros(SLOTS, np.bool_)
    for _ in range(STORED // SLOTS):
        seen, reached = rng.standard_normal((2, SLOTS, OBSERVATION), np.float32)
        actions = rng.uniform(-1.0, 1.0, (SLOTS, ACTION)).astype(np.float32)
        replay.add(seen, actions, rng.standard_normal(SLOTS, np.float32), reached, ended, ended)
    return replay

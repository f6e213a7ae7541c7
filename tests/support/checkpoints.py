"""Real checkpoints, and one that is faulty, for the tests of what races them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nathlon.policies import bundled
from nathlon.policies.checkpoint import load_checkpoint, save_checkpoint

BUNDLED = sorted((bundled.BUNDLED / "lindenring").glob("*.safetensors"))


def save_faulty(path: Path) -> None:
    """A checkpoint of finite weights whose actions are not: its layers overflow."""
    card = load_checkpoint(BUNDLED[0]).card.model_copy(update={"hidden": (8,) * 8})
    rng = np.random.default_rng(0)
    tensors = {
        name: rng.choice(np.array([-6e4, 6e4], np.float32), shape) for name, shape in card.shapes.items()
    }
    save_checkpoint(path, tensors, card)

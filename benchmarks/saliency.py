"""Which pixels move the steering of a policy that sees, for docs/training.md.

Run as `python -m benchmarks.saliency [--out FILE] [CHECKPOINT]`, by default with the one that comes with
nathlon for the Lindenring. It drives a lap alone and follows another car. Of twelve moments the sheet has
the picture, and below it how strongly each pixel moves the steering: the gradient's greatest part over its
colours, averaged over the steering angles that noise of ten of 255 leads to (Smilkov et al., 2017).
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image

from nathlon.arena.entrant import enter
from nathlon.arena.runner import run_match
from nathlon.arena.single_race import single_race
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import SeeingPolicy, read_checkpoint
from nathlon.policies.load import load_policy
from nathlon.policies.policy import Batch, Observations
from nathlon.policies.qrsac.recurrent import perceptron, recall
from nathlon.policies.sources import DRIVER
from nathlon.sim.observation import NUMBERS, PICTURE

OUT = Path(__file__).parent.parent / "docs" / "images" / "saliency.png"
CHECKPOINT = BUNDLED / "sight" / "lindenring-sight-crowd-012k.safetensors"
ALONE, TOGETHER = ("time_trial", 8), ("following", 4)
"""Scenarios, and how many moments are taken of each."""
COLUMNS, GAP, PIXEL = 4, 6, (4, 3)
NOISE, DRAWS = 10.0, 16


class Moment(NamedTuple):
    """What the policy saw, one record, and remembered, (1, m)."""

    seen: Observations
    memory: Batch


class Watched(SeeingPolicy):
    """A policy that notes what it sees of the first car."""

    def __init__(self, *facts: Any) -> None:
        super().__init__(*facts)
        self.moments: list[Moment] = []

    def act(self, observations: Observations, memory: Batch) -> tuple[Batch, Batch]:
        """As of `SeeingPolicy`."""
        self.moments.append(Moment(observations[:1].copy(), memory[:1].copy()))
        return super().act(observations, memory)


def driven(checkpoint: Path, scenario: str, count: int) -> tuple[Watched, list[Moment]]:
    """The policy, and so many moments of its race, evenly spread."""
    card, tensors = read_checkpoint(checkpoint)
    policy, where = Watched(card, str(checkpoint), tensors), (card.circuit, card.car)
    sources = [str(checkpoint), f"{DRIVER}:pace=0.9"][: 1 + (scenario == TOGETHER[0])]
    match = single_race([enter(source, *where) for source in sources], scenario, seed=1)
    run_match(match, [policy, *(load_policy(source, *where) for source in sources[1:])])
    at = np.linspace(0, len(policy.moments) - 1, count + 2)[1:-1].round().astype(int)
    return policy, [policy.moments[step] for step in at]


def saliency(policy: Watched, tensors: dict[str, torch.Tensor], moment: Moment) -> NDArray[np.float64]:
    """How strongly each pixel moves the steering, (height, width)."""
    vision = policy.card.vision
    assert vision is not None, "who sees has a vision"
    rng, total = np.random.default_rng(1), np.zeros(moment.seen[PICTURE].shape[1:3])
    for _ in range(DRAWS):
        picture = moment.seen[PICTURE].astype(np.float32)
        picture += rng.normal(0.0, NOISE, picture.shape).astype(np.float32)
        pixels = torch.from_numpy(picture[:, None]).requires_grad_()
        seen = [torch.from_numpy(moment.seen[NUMBERS][:, None].copy()), pixels]
        known, _ = recall(tensors, vision.strides, seen, torch.from_numpy(moment.memory))
        steering = perceptron(tensors, len(policy.card.hidden), known)[0, 0, 1]
        (gradient,) = torch.autograd.grad(steering, pixels)
        total += gradient[0, 0].abs().amax(-1).numpy()
    return total


def shown(moment: Moment, weights: NDArray[np.float64]) -> Image.Image:
    """The picture, and below it the same in grey with what moves the steering in red."""
    picture = moment.seen[PICTURE][0]
    share = np.clip(weights / np.quantile(weights, 0.995), 0.0, 1.0)[..., None]
    grey = 0.6 * picture.mean(axis=2, keepdims=True) + 80.0
    lit = (1.0 - share) * grey + share * np.array([230.0, 20.0, 30.0])
    whole = Image.fromarray(np.concatenate([picture, lit.astype(np.uint8)]))
    return whole.resize((whole.width * PIXEL[0], whole.height * PIXEL[1]), Image.Resampling.NEAREST)


def main() -> None:
    """Draw the sheet."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=OUT, metavar="FILE")
    parser.add_argument("checkpoint", nargs="?", type=Path, default=CHECKPOINT)
    chosen = parser.parse_args()
    pictures = []
    for scenario, count in (ALONE, TOGETHER):
        policy, moments = driven(chosen.checkpoint, scenario, count)
        tensors = {
            name: torch.from_numpy(each) for name, each in read_checkpoint(chosen.checkpoint)[1].items()
        }
        pictures += [shown(moment, saliency(policy, tensors, moment)) for moment in moments]
    width, height = (size + GAP for size in pictures[0].size)
    rows = -(-len(pictures) // COLUMNS)
    whole = Image.new("RGB", (COLUMNS * width + GAP, rows * height + GAP), "white")
    for number, picture in enumerate(pictures):
        whole.paste(picture, (GAP + number % COLUMNS * width, GAP + number // COLUMNS * height))
    whole.save(chosen.out, optimize=True)


if __name__ == "__main__":
    main()

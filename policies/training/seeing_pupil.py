"""A pupil that sees by a camera, and learns from passages of what it drove."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import conv2d, linear, smooth_l1_loss

from nathlon.policies.checkpoint import ACTION_SIZE, Card, SeeingPolicy
from nathlon.policies.policy import Policy
from nathlon.policies.training.actor import Saturating, Trained
from nathlon.policies.training.config import ImitationSettings
from nathlon.policies.training.instruction import Drive
from nathlon.policies.training.pupil import Rows, error, fresh
from nathlon.policies.vision import PREFIX, Vision
from nathlon.sim.errors import InputError
from nathlon.sim.observation import NUMBERS, PICTURE

TELLING = "telling."
"""What the names of the tensors begin with that tell what the teacher sees; no checkpoint has them."""
TOLD = 0.3
"""Error of what is told, in deviations, up to which it counts by its square."""


class SeeingActor(Trained):
    """The network of `nathlon.policies.vision` in PyTorch.

    Attributes:
        tensors_by_name: as of a card's `shapes`, and others that stand beside them.
    """

    def __init__(self, vision: Vision, tensors: Mapping[str, NDArray[np.float32]]) -> None:
        """Copies of tensors."""
        self._vision = vision
        self.tensors_by_name = {
            name: torch.from_numpy(tensor.copy()).requires_grad_() for name, tensor in tensors.items()
        }
        super().__init__(list(self.tensors_by_name.values()))

    def arrays(self, average: bool = False) -> dict[str, NDArray[np.float32]]:
        """The tensors as they are, or their average, by name."""
        tensors = self._averages if average else self._all
        return {
            name: tensor.detach().numpy().copy()
            for name, tensor in zip(self.tensors_by_name, tensors, strict=True)
        }

    def recall(self, pictures: Tensor, sensors: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """What is known at each step of some passages.

        Args:
            pictures: (passages, steps, height, width, channels) uint8.
            sensors: (passages, steps, numbers) float32.
            memory: (passages, m) float32, before the first step.

        Returns:
            (passages, steps, k), what the perceptron takes, and the memory after the last step.
        """
        known = torch.cat(
            [self._features(pictures.flatten(0, 1)).reshape(*pictures.shape[:2], -1), sensors], 2
        )
        if not self._vision.memory:
            return known, memory
        inputs, inputs_bias, own, own_bias = (
            self.tensors_by_name[f"{PREFIX}memory.{name}"]
            for name in ("inputs", "inputs_bias", "own", "own_bias")
        )
        weights = [inputs.T, own.T, inputs_bias, own_bias]
        known, after = torch.gru(known, memory[None], weights, True, 1, 0.0, False, False, True)
        return known, after[0]

    def _features(self, pictures: Tensor) -> Tensor:
        # The channels of a picture lie together, as those of `channels_last` do.
        seen = pictures.permute(0, 3, 1, 2).float() / 255.0
        for index, layer in enumerate(self._vision.convolutions):
            weight = self.tensors_by_name[f"{PREFIX}{index}.weight"].to(memory_format=torch.channels_last)
            seen = torch.relu(
                conv2d(seen, weight, self.tensors_by_name[f"{PREFIX}{index}.bias"], layer.stride)
            )
        return torch.relu(self._linear(f"{PREFIX}features.", seen.flatten(1)))

    def means(self, known: Tensor) -> Tensor:
        """Mean actions (.., 2) by what is known, (.., k)."""
        last = sum(name[0].isdecimal() for name in self.tensors_by_name) // 2 - 1
        for index in range(last):
            known = torch.relu(self._linear(f"{index}.", known))
        sums = self._linear(f"{last}.", known)[..., :ACTION_SIZE]
        means: Tensor = Saturating.apply(sums)
        return means

    def told(self, known: Tensor) -> Tensor:
        """What the teacher sees, by what is known."""
        return self._linear(TELLING, known)

    def _linear(self, prefix: str, inputs: Tensor) -> Tensor:
        return linear(
            inputs, self.tensors_by_name[f"{prefix}weight"].T, self.tensors_by_name[f"{prefix}bias"]
        )


def note_passages(drive: Drive) -> dict[str, NDArray[Any]]:
    """All that passages are made of, car by car; `left` is how many steps of the same car follow."""
    driving = drive.driving.T
    follows = driving[:, 1:] & ~drive.begun.T[:, 1:]
    left = np.zeros(driving.shape, np.int32)
    for step in range(follows.shape[1] - 1, -1, -1):
        left[:, step] = np.where(follows[:, step], left[:, step + 1] + 1, 0)

    def by_car(values: NDArray[Any]) -> NDArray[Any]:
        return np.swapaxes(values, 0, 1)[driving]

    return {
        PICTURE: by_car(drive.seen[PICTURE]),
        NUMBERS: by_car(drive.seen[NUMBERS]),
        "memory": by_car(drive.memory).astype(np.float16),
        "said": by_car(drive.said),
        "shown": by_car(drive.shown).astype(np.float16),
        "left": left[driving],
    }


class SeeingPupil:
    """A pupil that sees by a camera.

    Attributes:
        trained, note: as of `nathlon.policies.training.pupil.Pupil`.
    """

    def __init__(
        self, card: Card, settings: ImitationSettings, batch: int, shown: int, rng: np.random.Generator
    ) -> None:
        """A pupil that has learnt nothing.

        Args:
            card: of the policy.
            settings: lengths of passages, and what the error of what is told weighs.
            batch: steps of a minibatch.
            shown: how many numbers the teacher sees.
            rng: draws its first tensors.
        """
        assert card.vision is not None, "who sees has a vision"
        self._card, self._settings = card, settings
        self._passages = max(batch // settings.passage, 1)
        tensors = fresh(card, rng)
        if settings.telling:
            tensors[f"{TELLING}weight"] = np.zeros((card.widths[0], shown), np.float32)
            tensors[f"{TELLING}bias"] = np.zeros(shown, np.float32)
        self.trained = SeeingActor(card.vision, tensors)
        self.note = note_passages

    @property
    def policy(self) -> Policy:
        """As it is, to drive with."""
        return SeeingPolicy(self._card, "", self._own(self.trained.arrays()))

    def losses(self, rounds: Sequence[Rows], rng: np.random.Generator) -> Iterator[Tensor]:
        """As of `Pupil`.

        Raises:
            InputError: if no car drove for as long as a passage.
        """
        settings, length = self._settings, self._settings.passage
        starts = [np.flatnonzero(rows["left"].numpy() >= length - 1) for rows in rounds]
        ends = np.cumsum([len(each) for each in starts])
        if not ends[-1]:
            raise InputError(f"imitation: no car drove for the {length} steps of a passage, expected some")
        while True:
            chosen = rng.integers(ends[-1], size=self._passages)
            which = np.searchsorted(ends, chosen, side="right")
            places = [
                (rounds[turn], int(starts[turn][number - ends[turn]]))
                for turn, number in zip(which, chosen, strict=True)
            ]
            pictures, sensors, said, shown = (
                torch.stack([rows[name][start : start + length] for rows, start in places])
                for name in (PICTURE, NUMBERS, "said", "shown")
            )
            memory = torch.stack([rows["memory"][start] for rows, start in places]).float()
            yield self._loss(pictures, sensors, memory, said, shown.float(), settings.recalled)

    def _loss(
        self, pictures: Tensor, sensors: Tensor, memory: Tensor, said: Tensor, shown: Tensor, recalled: int
    ) -> Tensor:
        if recalled:
            with torch.no_grad():
                _, memory = self.trained.recall(pictures[:, :recalled], sensors[:, :recalled], memory)
        known, _ = self.trained.recall(pictures[:, recalled:], sensors[:, recalled:], memory)
        loss = error(self.trained.means(known), said[:, recalled:])
        if self._settings.telling:
            missed = smooth_l1_loss(self.trained.told(known), shown[:, recalled:], beta=TOLD)
            loss = loss + self._settings.telling * missed
        return loss

    def averaged(self) -> dict[str, NDArray[np.float32]]:
        """As of `Pupil`."""
        return self._own(self.trained.arrays(average=True))

    def _own(self, arrays: Mapping[str, NDArray[np.float32]]) -> dict[str, NDArray[np.float32]]:
        """What a checkpoint has of them."""
        return {name: arrays[name] for name in self._card.shapes}

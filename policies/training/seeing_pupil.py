"""A pupil that sees by a camera, and learns from passages of what it drove."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import smooth_l1_loss

from nathlon.policies.checkpoint import Card
from nathlon.policies.policy import Policy
from nathlon.policies.training.config import ImitationSettings
from nathlon.policies.training.instruction import Taught
from nathlon.policies.training.pupil import Rows, error
from nathlon.policies.training.seeing_actor import SeeingActor
from nathlon.sim.errors import InputError
from nathlon.sim.observation import NUMBERS, PICTURE, ObservationSpec

TELLING = "telling."
"""What the names of the tensors begin with that tell what the teacher sees; no checkpoint has them."""
TOLD = 0.3
"""Error of what is told, in deviations, up to which it counts by its square."""


def note_passages(drive: Taught) -> dict[str, NDArray[Any]]:
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
        self,
        card: Card,
        settings: ImitationSettings,
        batch: int,
        shown: ObservationSpec,
        tensors: dict[str, NDArray[np.float32]],
    ) -> None:
        """A pupil at its beginning.

        Args:
            card: of the policy.
            settings: lengths of passages, and what the error of what is told weighs.
            batch: steps of a minibatch.
            shown: what the teacher sees.
            tensors: its first ones, of the card's shapes.
        """
        assert card.vision is not None, "who sees has a vision"
        self._card, self._settings = card, settings
        self._passages = max(batch // settings.passage, 1)
        if settings.telling:
            tensors = dict(tensors)
            tensors[f"{TELLING}weight"] = np.zeros((card.widths[0], shown.size), np.float32)
            tensors[f"{TELLING}bias"] = np.zeros(shown.size, np.float32)
        self.trained = SeeingActor(card, tensors)
        self.note = note_passages

    @property
    def policy(self) -> Policy:
        """As it is, to drive with."""
        return self.trained.policy

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
        loss = error(self.trained.actions(known), said[:, recalled:])
        if self._settings.telling:
            told, shown = self.trained.linear(TELLING, known), shown[:, recalled:]
            loss = loss + self._settings.telling * smooth_l1_loss(told, shown, beta=TOLD)
        return loss

    def averaged(self) -> dict[str, NDArray[np.float32]]:
        """As of `Pupil`."""
        return {name: tensor.copy() for name, tensor in self.trained.averages()}

"""Policies that a program hands over as objects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from nathlon.arena.entrance import enter_all
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.load import load_policy
from nathlon.policies.mlp import EncodedMlp, Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.sources.handed_over import hand_over
from nathlon.policies.sources.identity import policy_id
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.support.checkpoints import BUNDLED

PLACE = ("lindenring", "gt3")


class Gentle:
    """Of this module, and with something that no other process could be given."""

    observation_spec = ObservationSpec(course_points=1)

    def __init__(self, throttle: float) -> None:
        self.throttle = throttle
        self.asked = 0

    def __getstate__(self) -> float:
        return self.throttle

    def initial_memory(self, n: int) -> Batch:
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        self.asked += 1
        return np.tile(np.array([[self.throttle, 0.0]], np.float32), (len(observations), 1)), memory


def test_an_object_races_here_beside_policies_that_race_elsewhere(pool: Pool) -> None:
    mine = Gentle(0.25)
    sources = [hand_over(mine, "mine"), "driver", str(BUNDLED[0])]
    entrants = enter_all(pool, sources, *PLACE)
    assert (entrants[0].name, entrants[0].algorithm) == ("mine", "object")
    matches = [
        Match("t", "t", "slipstream_pass", *PLACE, (a.id, b.id), (a.source, b.source), (Race(1, SEATS),))
        for a, b in [(entrants[0], entrants[1]), (entrants[1], entrants[2])]
    ]
    results = dict(pool.run(matches))
    assert set(results) == set(matches)
    assert mine.asked > 10
    assert "policy_raised" not in results[matches[0]]["ending"]
    [(_, answer)] = pool.record([Wanted(matches[0], (0,), ("mine", "driver"), results[matches[0]])])
    assert not isinstance(answer, InputError)


SEATS = (Seat(0), Seat(1))


def test_what_it_consists_of_tells_an_object_apart() -> None:
    source = hand_over(Gentle(0.5), "half")
    identity = policy_id(source)
    assert policy_id(hand_over(Gentle(0.5), "half")) == identity
    with pytest.raises(InputError, match="'half': handed over before with other contents"):
        hand_over(Gentle(0.6), "half")
    assert policy_id(hand_over(load_checkpoint(BUNDLED[0]), "bundled")) == policy_id(str(BUNDLED[0]))


def test_what_is_no_policy_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="field observation_spec is missing"):
        hand_over(object(), "none")  # type: ignore[arg-type]
    open_file = Gentle(0.1)
    open_file.__class__ = Unwritable
    with pytest.raises(InputError, match="'open': cannot be pickled"):
        hand_over(open_file, "open")
    with pytest.raises(InputError, match="object:unknown: lives only in the program that made it"):
        load_policy("object:unknown", *PLACE)


class Unwritable(Gentle):
    def __getstate__(self) -> float:
        raise TypeError("not me")


class Network(torch.nn.Module):
    """One layer, with a buffer as large as the last batch and how often it was asked."""

    scratch: torch.Tensor

    def __init__(self, gain: float) -> None:
        super().__init__()
        self.gain = torch.nn.Parameter(torch.full((1,), gain))
        self.register_buffer("scratch", torch.zeros(1), persistent=False)

    def forward(self, rows: torch.Tensor) -> torch.Tensor:
        self.scratch = torch.zeros(len(rows)).add_(self.gain)
        return self.scratch


class WithNetworks(Gentle):
    """Its networks note things for themselves when they are asked, and so does it."""

    def __init__(self, gain: float) -> None:
        super().__init__(0.2)
        layer = np.full((3, 2), gain, np.float32), np.zeros(2, np.float32)
        plain = Mlp((layer,), "relu", "clip")
        encoder = Mlp(((np.eye(1, dtype=np.float32), np.zeros(1, np.float32)),), "relu", "linear")
        self.networks: list[Any] = [plain, EncodedMlp(encoder, plain, 1), Network(gain)]

    def __getstate__(self) -> Any:
        return object.__getstate__(self)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        for network in self.networks[:2]:
            network(np.ones((len(observations), 3), np.float32))
        self.networks[2](torch.zeros(len(observations)))
        return super().act(observations, memory)


def test_what_an_object_notes_in_use_does_not_make_it_another_one() -> None:
    policy = WithNetworks(0.5)
    source = hand_over(policy, "notes")
    identity = policy_id(source)
    policy.act(np.zeros((2, 1), np.float32), policy.initial_memory(2))
    assert policy_id(source) == identity
    policy.asked = 0
    assert policy_id(hand_over(policy, "notes")) == identity, "the networks are what they were"
    policy.asked = 1
    assert policy_id(hand_over(policy, "notes")) != identity, "the same object may have become another policy"
    other = WithNetworks(0.25)
    assert policy_id(hand_over(other, "other")) != identity
    assert policy_id(hand_over(WithNetworks(0.5), "equal")) == identity

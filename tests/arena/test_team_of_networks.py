"""Which networks are asked together."""

from __future__ import annotations

import numpy as np
import pytest

from nathlon.arena import team_of_networks
from nathlon.arena.team import Team
from nathlon.arena.team_of_networks import TeamOfNetworks, join_networks
from nathlon.policies.bundled import generalist
from nathlon.policies.checkpoint import Card, NetworkPolicy, load_checkpoint
from nathlon.policies.mlp import FEW
from nathlon.policies.policy import Policy
from tests.support.checkpoints import BUNDLED

FIRST, LAST = load_checkpoint(BUNDLED[0]), load_checkpoint(BUNDLED[-1])


def team(policy: Policy, cars: int = 2) -> Team:
    return Team(policy, np.arange(cars), 0, 0)


def of_shape(card: Card) -> NetworkPolicy:
    rng = np.random.default_rng(0)
    tensors = {name: rng.standard_normal(shape, np.float32) for name, shape in card.shapes.items()}
    return NetworkPolicy(card, "", tensors)


def test_networks_of_one_shape_with_few_cars_are_joined() -> None:
    narrow = of_shape(FIRST.card.model_copy(update={"hidden": (8,)}))
    teams = [team(FIRST), team(narrow), team(LAST, FEW), team(narrow, 1)]
    wide, small = join_networks(teams)
    assert isinstance(wide, TeamOfNetworks)
    assert isinstance(small, TeamOfNetworks)
    assert wide.cars.tolist() == [0, 1, *range(FEW)]
    assert small.cars.tolist() == [0, 1, 0]


def test_others_stay_by_themselves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those with many cars, with an encoder, or so large that they are to be watched."""
    encoded = load_checkpoint(generalist())
    teams = [team(FIRST, FEW + 1), team(LAST, FEW + 1), team(encoded), team(FIRST)]
    assert join_networks(teams)[:3] == teams[:3]
    monkeypatch.setattr(team_of_networks, "LARGE", 100_000)
    assert join_networks(teams) == teams

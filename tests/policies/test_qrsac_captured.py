"""Updates captured as a CUDA graph."""

from __future__ import annotations

import pytest
import torch

from nathlon.policies.qrsac.learner import QRSAC
from tests.support.qrsac import ACTION, OBSERVATION, batches, config

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")


@pytest.mark.parametrize("dropout", [0.0, 0.1])
def test_updates_of_one_graph_are_those_made_one_by_one(dropout: float) -> None:
    """Also of a second replay, whose inputs and rates differ from those captured."""
    settings = config(precision="float32", dropout=dropout, final_rates=0.1)
    single, several = (
        QRSAC(OBSERVATION, ACTION, settings, torch.Generator("cuda").manual_seed(0), False, updates=6)
        for _ in range(2)
    )
    parts = batches(6)
    for start in (0, 3):
        expected = [single.update(batch) for batch in parts[start : start + 3]]
        sample = iter(parts[start : start + 3]).__next__
        torch.testing.assert_close(several.updates(sample, 3), expected[-1])
    torch.testing.assert_close(several.state_dict(), single.state_dict())

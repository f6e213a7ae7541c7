"""Updates of QR-SAC as they are compiled.

In a module of their own: what a process needs before it can compile takes longer than the compilation.
"""

from __future__ import annotations

import shutil

import pytest
import torch

from tests.support.qrsac import batches, learner

pytestmark = [
    pytest.mark.takes_long,
    pytest.mark.skipif(not any(map(shutil.which, ("g++", "c++", "clang++"))), reason="needs a C++ compiler"),
]


def test_updates_equal_eager_ones() -> None:
    """Of learners of one shape, each with its own configuration, and of rates that change as they go."""
    changing = {"updates": 6, "final_rates": 0.1, "final_alpha": 0.1}
    for configuration in ({"polyak": 0.5, **changing}, {"polyak": 0.01}):
        eager, compiled = (
            learner(compiled=each, hidden=(8,), **configuration)  # type: ignore[arg-type]
            for each in (False, True)
        )
        for batch in batches(3):
            expected, found = eager.update(batch), compiled.update(batch)
            torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-5)
        torch.testing.assert_close(compiled.state_dict(), eager.state_dict(), rtol=1e-4, atol=1e-5)

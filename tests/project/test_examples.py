"""The examples of the documentation run as they stand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parent.parent.parent / "docs" / "environments.md"
EXAMPLES = re.findall(r"## ([^\n]+)\n\n```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)


def test_every_face_has_an_example() -> None:
    assert [heading for heading, _ in EXAMPLES] == [
        "PettingZoo",
        "Gymnasium",
        "Gymnasium, many races at once",
        "Stable-Baselines3",
        "Pictures",
        "QR-SAC on any environment",
        "A formula as the reward",
    ]


@pytest.mark.parametrize(("heading", "example"), EXAMPLES, ids=[heading for heading, _ in EXAMPLES])
def test_an_example_runs(heading: str, example: str) -> None:
    exec(compile(example, heading, "exec"), {})

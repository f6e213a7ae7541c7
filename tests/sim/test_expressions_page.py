"""The page of the expression language says what there is."""

from __future__ import annotations

import re
from pathlib import Path

from nathlon.sim.expressions import pure_number
from nathlon.sim.expressions.functions import FUNCTIONS
from nathlon.sim.expressions.unit import CONSTANTS
from nathlon.sim.instruments import QUANTITIES

PAGE = (Path(__file__).parent.parent.parent / "docs" / "expressions.md").read_text("utf-8")


def test_all_quantities_stand_in_the_table_with_unit_range_and_meaning() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \| (\S+) to (\S+) \| (.+) \|$", PAGE, re.MULTILINE)
    assert rows == [(name, q.unit, f"{q.low:g}", f"{q.high:g}", q.meaning) for name, q in QUANTITIES.items()]


def test_all_functions_and_units_are_told() -> None:
    functions = re.findall(r"^\| `(\w+)\(.*\)` \| (.+) \|$", PAGE, re.MULTILINE)
    assert functions == [(name, function.meaning) for name, function in FUNCTIONS.items()]
    [units] = re.findall(r"There are (.+); angles", PAGE)
    assert re.findall(r"`(\w+)`", units) == list(CONSTANTS)


def test_the_first_example_is_a_reward() -> None:
    [text] = re.findall(r'^expression = "(.+)"$', PAGE, re.MULTILINE)
    assert pure_number(text, QUANTITIES).low < 0.0

"""Expressions over quantities: text that is parsed, checked and computed, and never executed.

The text is read as a syntax tree of few kinds of nodes. Each node is given its unit and the range of its
values, so that what cannot be added is refused, and so is what might divide by zero or grow beyond all
bounds. What is left computes, for arrays of any shape, numbers that are finite.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from nathlon.sim.errors import InputError
from nathlon.sim.expressions.compiling import Compiler
from nathlon.sim.expressions.part import Compute, Readings, Values
from nathlon.sim.expressions.quantity import Quantity
from nathlon.sim.expressions.text import parse_text
from nathlon.sim.expressions.unit import NUMBER, Unit

__all__ = ["Expression", "Quantity", "Readings", "Unit", "Values", "pure_number", "read_expression"]


@dataclass(frozen=True)
class Expression:
    """A checked expression.

    Attributes:
        text: written in one way: texts that differ in spaces and needless parentheses only have the same.
        names: of its quantities, ordered.
        unit: of its values.
        low, high: between which its values lie.
    """

    text: str
    names: tuple[str, ...]
    unit: Unit
    low: float
    high: float
    _compute: Compute = field(repr=False, compare=False)

    def __call__(self, readings: Readings) -> Values:
        """Its values, of the shape of the readings; of one that has no quantities, a single number.

        Args:
            readings: float64, of the quantities in `names` at least; none is nan.
        """
        return np.asarray(self._compute(readings), np.float64)


def read_expression(text: str, quantities: Mapping[str, Quantity]) -> Expression:
    """The expression that a text says.

    Args:
        text: at most `nathlon.sim.expressions.text.LONGEST` characters, on any number of lines.
        quantities: what it may be about, by name.

    Raises:
        InputError: if it is none, names anything else, adds what has different units, or may divide by zero
            or exceed all bounds; with the column.
    """
    tree = parse_text(text)
    part = Compiler(quantities).compile(tree)
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} & set(quantities)
    return Expression(
        ast.unparse(tree), tuple(sorted(names)), part.dimension, *part.range, _compute=part.compute
    )


def pure_number(text: str, quantities: Mapping[str, Quantity]) -> Expression:
    """As `read_expression`, of an expression whose values are pure numbers, such as a reward.

    Raises:
        InputError: also if they have a unit, or there is no quantity in it.
    """
    expression = read_expression(text, quantities)
    if expression.unit != NUMBER:
        raise InputError(
            f"column 1: the expression is in {expression.unit}, expected a pure number: divide by the unit"
        )
    if not expression.names:
        raise InputError("column 1: the expression is the same always, expected one with a quantity")
    return expression

"""From a syntax tree to a part that can be computed, node by node, with units and ranges checked."""

from __future__ import annotations

import ast
import difflib
import math
from collections.abc import Mapping
from fractions import Fraction
from functools import partial

import numpy as np

from nathlon.sim.errors import InputError
from nathlon.sim.expressions.functions import FUNCTIONS, common
from nathlon.sim.expressions.part import (
    TRUTH,
    ExpressionPart,
    Function,
    Range,
    Readings,
    Values,
    apply,
    constant,
)
from nathlon.sim.expressions.quantity import Quantity
from nathlon.sim.expressions.text import fault
from nathlon.sim.expressions.unit import CONSTANTS, NUMBER, Unit

LARGEST = 1e9
"""Magnitude of any value on the way."""
HIGHEST_POWER = 8.0

COMPARISONS: dict[type[ast.cmpop], Function] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
TOGETHER: dict[type[ast.boolop], Function] = {ast.And: np.logical_and, ast.Or: np.logical_or}


class Compiler:
    """Compiles expressions over some quantities."""

    def __init__(self, quantities: Mapping[str, Quantity]) -> None:
        """A compiler.

        Args:
            quantities: by name; their units are units of the language as well.

        Raises:
            InputError: if a quantity has no unit or range, or a name that means something else.
        """
        self._quantities = quantities
        self._constants = dict(CONSTANTS)
        for name, quantity in quantities.items():
            if not name.isidentifier() or name in FUNCTIONS or name in CONSTANTS:
                raise InputError(f"quantity {name!r}: expected a name that means nothing else")
            if not (
                math.isfinite(quantity.low) and math.isfinite(quantity.high) and quantity.low <= quantity.high
            ):
                raise InputError(
                    f"quantity {name!r}: lies from {quantity.low} to {quantity.high}, expected a range"
                )
            for base, _ in Unit.parse(quantity.unit).powers:
                self._constants.setdefault(base, (1.0, Unit.of(**{base: 1})))
        self._units = {name: Unit.parse(quantity.unit) for name, quantity in quantities.items()}

    def compile(self, node: ast.expr) -> ExpressionPart:
        """The part that a node stands for.

        Raises:
            InputError: if a name is unknown, units do not go together, or values may have no bounds.
        """
        match node:
            case ast.Constant():
                part = self._literal(node)
            case ast.Name():
                part = self._name(node)
            case ast.UnaryOp():
                part = self._unary(node)
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                part = self._sum(node)
            case ast.BinOp(op=ast.Pow()):
                part = self._power(node)
            case ast.BinOp():
                part = self._product(node)
            case ast.BoolOp():
                part = self._logical(node)
            case ast.Compare():
                part = self._comparison(node)
            case ast.IfExp():
                part = self._choice(node)
            case ast.Call():
                part = self._call(node)
            case _:
                raise fault(node, "is not part of the language")
        if part.range.largest > LARGEST:
            raise fault(node, f"may be as large as {part.range.largest:g}, expected at most {LARGEST:g}")
        return part

    def _literal(self, node: ast.Constant) -> ExpressionPart:
        value = node.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise fault(node, f"{value!r} is no number")
        if not abs(value) <= LARGEST:
            raise fault(node, f"a number larger than {LARGEST:g}")
        return constant(float(value), None if value == 0 else NUMBER)

    def _name(self, node: ast.Name) -> ExpressionPart:
        name = node.id
        if name in self._quantities:
            quantity = self._quantities[name]
            reading = partial(_reading, name, quantity.low, quantity.high)
            return ExpressionPart(self._units[name], Range(quantity.low, quantity.high), reading)
        if name in self._constants:
            return constant(*self._constants[name])
        if name in FUNCTIONS:
            raise fault(node, f"{name!r} is a function, expected its arguments in parentheses")
        raise fault(node, f"{name!r} is no quantity, {self._expected(name)}")

    def _expected(self, name: str) -> str:
        known = sorted([*self._quantities, *self._constants])
        near = difflib.get_close_matches(name, known, n=3)
        return f"expected one like {', '.join(near)}" if near else f"expected one of {', '.join(known)}"

    def _unary(self, node: ast.UnaryOp) -> ExpressionPart:
        inner = self.compile(node.operand)
        low, high = inner.range
        match node.op:
            case ast.USub():
                return ExpressionPart(inner.unit, Range(-high, -low), apply(np.negative, [inner]))
            case ast.UAdd():
                return inner
        self._check_truth(node.operand, inner)
        return ExpressionPart(NUMBER, TRUTH, apply(_numbers(np.logical_not), [inner]))

    def _sum(self, node: ast.BinOp) -> ExpressionPart:
        left, right = self.compile(node.left), self.compile(node.right)
        unit = self._common(node, left, right)
        (a, b), (c, d) = left.range, right.range
        subtracts = isinstance(node.op, ast.Sub)
        reach = Range(a - d, b - c) if subtracts else Range(a + c, b + d)
        return ExpressionPart(unit, reach, apply(np.subtract if subtracts else np.add, [left, right]))

    def _product(self, node: ast.BinOp) -> ExpressionPart:
        left, right = self.compile(node.left), self.compile(node.right)
        (a, b), (c, d) = left.range, right.range
        if isinstance(node.op, ast.Mult):
            reach = Range.around([a * c, a * d, b * c, b * d])
            return ExpressionPart(left.dimension * right.dimension, reach, apply(np.multiply, [left, right]))
        if not isinstance(node.op, ast.Div):
            raise fault(node, "is not part of the language")
        if right.range.holds_zero:
            raise fault(
                node.right, f"divides by what may be 0 (from {c:g} to {d:g}), expected as with max(.., 1)"
            )
        reach = Range.around([a / c, a / d, b / c, b / d])
        return ExpressionPart(left.dimension / right.dimension, reach, apply(np.divide, [left, right]))

    def _power(self, node: ast.BinOp) -> ExpressionPart:
        base, exponent = self.compile(node.left), self.compile(node.right)
        power = exponent.range.low
        if exponent.range.low != exponent.range.high or exponent.dimension != NUMBER:
            raise fault(node.right, "the power is not a number, expected as in speed ** 2")
        if abs(power) > HIGHEST_POWER or (2.0 * power) % 1.0:
            raise fault(node.right, f"the power is {power:g}, expected a half or a whole one from -8 to 8")
        low, high = base.range
        if power < 0 and base.range.holds_zero:
            raise fault(node.left, f"divides by what may be 0 (from {low:g} to {high:g})")
        if power % 1.0 and low < 0.0:
            raise fault(node.left, f"may be as low as {low:g}, expected none below 0 under a root")
        if max(abs(power) * math.log10(max(edge, 1e-300)) for edge in (abs(low), abs(high), 1.0)) > 300.0:
            raise fault(node, f"may be larger than {LARGEST:g}")
        ends = [low**power, high**power]
        if base.range.holds_zero:
            ends.append(0.0**power)
        unit = base.dimension ** Fraction(power)
        return ExpressionPart(unit, Range.around(ends), lambda readings: base.compute(readings) ** power)

    def _logical(self, node: ast.BoolOp) -> ExpressionPart:
        parts = [self.compile(value) for value in node.values]
        for value, part in zip(node.values, parts, strict=True):
            self._check_truth(value, part)
        function = TOGETHER[type(node.op)]
        return ExpressionPart(NUMBER, TRUTH, apply(_numbers(_folded(function)), parts))

    def _comparison(self, node: ast.Compare) -> ExpressionPart:
        sides = [self.compile(side) for side in (node.left, *node.comparators)]
        found = []
        for op, left, right in zip(node.ops, sides, sides[1:], strict=False):
            self._common(node, left, right)
            found.append(ExpressionPart(NUMBER, TRUTH, apply(_numbers(COMPARISONS[type(op)]), [left, right])))
        if len(found) == 1:
            return found[0]
        return ExpressionPart(NUMBER, TRUTH, apply(_numbers(_folded(np.logical_and)), found))

    def _choice(self, node: ast.IfExp) -> ExpressionPart:
        condition = self.compile(node.test)
        self._check_truth(node.test, condition)
        parts = [self.compile(node.body), self.compile(node.orelse)]
        unit = self._common(node, *parts)
        reach = Range.around([edge for part in parts for edge in part.range])
        return ExpressionPart(unit, reach, apply(_choose, [condition, *parts]))

    def _call(self, node: ast.Call) -> ExpressionPart:
        if not isinstance(node.func, ast.Name) or node.func.id not in FUNCTIONS:
            called = ast.unparse(node.func)
            raise fault(node, f"{called!r} is no function, expected one of {', '.join(FUNCTIONS)}")
        name, function = node.func.id, FUNCTIONS[node.func.id]
        if not function.least <= len(node.args) <= function.most:
            many = f"{function.least}" + (f" to {function.most}" if function.most > function.least else "")
            raise fault(node, f"{name} has {len(node.args)} arguments, expected {many}")
        parts = [self.compile(argument) for argument in node.args]
        try:
            unit, reach = function.unit(parts), function.range([part.range for part in parts])
        except InputError as error:
            raise fault(node, f"{name}: {error}") from None
        return ExpressionPart(unit, reach, apply(function.function, parts))

    def _common(self, node: ast.AST, left: ExpressionPart, right: ExpressionPart) -> Unit | None:
        try:
            return common([left, right])
        except InputError as error:
            raise fault(node, str(error)) from None

    def _check_truth(self, node: ast.AST, part: ExpressionPart) -> None:
        if part.dimension != NUMBER:
            raise fault(
                node, f"a condition in {part.dimension}, expected a comparison as in speed > 10 * m/s"
            )


def _reading(name: str, low: float, high: float, readings: Readings) -> Values:
    return np.clip(readings[name], low, high)


def _numbers(function: Function) -> Function:
    """A function whose truths are 1 and 0."""
    return lambda *values: function(*values).astype(np.float64)


def _folded(function: Function) -> Function:
    """A function of two made one of several."""

    def fold(*values: Values) -> Values:
        folded = values[0]
        for value in values[1:]:
            folded = function(folded, value)
        return folded

    return fold


def _choose(condition: Values, then: Values, otherwise: Values) -> Values:
    return np.where(condition != 0.0, then, otherwise)

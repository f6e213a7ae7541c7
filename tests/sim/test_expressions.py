"""The expression language: what it computes, against Python's own reading, and what it refuses."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nathlon.sim.errors import InputError
from nathlon.sim.expressions import Quantity, pure_number, read_expression
from nathlon.sim.expressions.unit import Unit

QUANTITIES = {
    "a": Quantity("1", -3.0, 5.0, "a number"),
    "b": Quantity("1", 0.0, 2.0, "another"),
    "c": Quantity("1", 1.0, 9.0, "never 0"),
    "speed": Quantity("m/s", 0.0, 150.0, ""),
    "gap": Quantity("m", 0.0, 500.0, ""),
    "lateral": Quantity("m", -50.0, 50.0, ""),
    "mass": Quantity("kg", 1.0, 5000.0, ""),
    "score": Quantity("points", 0.0, 10.0, "of a world with a unit of its own"),
}
PYTHON: dict[str, Any] = {
    **{name: getattr(math, name) for name in ("sqrt", "exp", "log", "tanh", "sin", "cos")},
    **{"abs": abs, "min": min, "max": max, "clip": lambda x, low, high: min(max(x, low), high)},
}


def value(text: str, **readings: float) -> float:
    expression = read_expression(text, QUANTITIES)
    return float(expression({name: np.array(reading) for name, reading in readings.items()}))


leaves = st.sampled_from(["a", "b", "c", "0", "1", "2.5", "1e-3", "7"])
texts = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "<", "<=", ">", ">=", "==", "!="]), inner)
        .map(" ".join)
        .map("({})".format),
        inner.map("(-{})".format),
        st.tuples(inner, st.sampled_from(["2", "3", "-1", "0.5"])).map(" ** ".join).map("({})".format),
        st.tuples(inner, inner, inner).map(lambda three: "({} if {} else {})".format(*three)),
        st.tuples(st.sampled_from(["abs", "sqrt", "exp", "log", "tanh", "sin", "cos"]), inner).map(
            lambda call: "{}({})".format(*call)
        ),
        st.tuples(st.sampled_from(["min", "max"]), inner, inner).map(lambda call: "{}({}, {})".format(*call)),
        st.tuples(inner, inner, inner).map(lambda three: "clip({}, {}, {})".format(*three)),
    ),
    max_leaves=12,
)


@given(
    texts,
    st.floats(-3.0, 5.0),
    st.floats(0.0, 2.0),
    st.floats(1.0, 9.0),
)
def test_what_is_accepted_means_what_python_means_and_stays_in_its_range(
    text: str, a: float, b: float, c: float
) -> None:
    try:
        expression = read_expression(text, QUANTITIES)
    except InputError:
        return
    found = float(expression({"a": np.array(a), "b": np.array(b), "c": np.array(c)}))
    assert math.isfinite(found)
    slack = 1e-9 * max(1.0, abs(expression.low), abs(expression.high))
    assert expression.low - slack <= found <= expression.high + slack
    independent = eval(text, {"__builtins__": {}}, PYTHON | {"a": a, "b": b, "c": c})
    assert found == pytest.approx(float(independent), rel=1e-9, abs=1e-9)


@given(st.text(max_size=60) | st.text("abcspeed0123456789.+-*/()<>=!, _ifelsnotrd", max_size=60))
def test_any_text_is_an_expression_or_one_sentence_with_a_column(text: str) -> None:
    try:
        read_expression(text, QUANTITIES)
    except InputError as error:
        sentence = str(error)
    else:
        sentence = "column 1"
    assert sentence.startswith("column ")


def test_units_are_carried_through() -> None:
    assert value("speed / (100 * km / h)", speed=100.0 / 3.6) == pytest.approx(1.0)
    assert value("90 * deg", a=0.0) == pytest.approx(math.pi / 2)
    for text, unit in (
        ("speed ** 2 / gap if gap > 5 * m else 3 * m/s**2", None),
        ("mass * speed / s", "kg m/s^2"),
        ("sqrt(gap ** 2 + lateral ** 2)", "m"),
        ("max(lateral, 0)", "m"),
        ("(2 * gap) ** 0.5 * m ** 0.5", "m"),
        ("1 / (speed + 1 * m/s)", "s/m"),
        ("score / (2 * points)", "1"),
        ("speed > 3 * m/s and not gap < 2 * m", "1"),
    ):
        if unit is None:
            with pytest.raises(InputError, match="may be 0"):
                read_expression(text, QUANTITIES)
        else:
            assert read_expression(text, QUANTITIES).unit == Unit.parse(unit), text


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("speed + mass", "column 1: m/s and kg do not go together"),
        ("a + speed * 2", "column 1: a pure number and m/s do not go together"),
        ("2 * (gap < 3)", "column 6: m and a pure number do not go together"),
        ("a +\n  sped", "column 7: 'sped' is no quantity, expected one like speed"),
        ("a / b", "column 5: divides by what may be 0 (from 0 to 2)"),
        ("a ** -1", "column 1: divides by what may be 0 (from -3 to 5)"),
        ("a + sqrt(a)", "column 5: sqrt: the argument may be as low as -3, expected none below 0"),
        ("log(b)", "column 1: log: the argument may be as low as 0, expected above 0"),
        ("exp(gap / m)", "column 1: may be as large as"),
        ("exp(speed)", "column 1: exp: the argument is in m/s, expected a pure number"),
        ("2 ** a", "column 6: the power is not a number"),
        ("c ** 9", "column 6: the power is 9"),
        ("a if gap else b", "column 6: a condition in m, expected a comparison"),
        ("a b", "column 3: no expression can go on here"),
        ("a ^ 2", "column 3: '^' means nothing here"),
        ("a.real", "column 1: a name after a dot is not part of the language"),
        ("a // 2", "column 1: // is not part of the language"),
        ("__import__('os')", "column 12: "),
        ("eval(a)", "column 1: 'eval' is no function, expected one of abs, min, max"),
        ("min(a)", "column 1: min has 1 arguments, expected 2 to 10"),
        ("clip(a, b, *c)", "is not part of the language"),
        ("abs", "column 1: 'abs' is a function"),
        ("True", "column 1: True is no number"),
        ("1e400", "column 1: a number larger than 1e+09"),
        ("", "column 1: nothing there"),
        ("-" * 1500 + "1", "nested at most 100 deep"),
        ("(" * 300 + "1" + ")" * 300, "column "),
        ("+".join("a" * 1001), "2001 characters, expected at most 2000"),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_column(text: str, sentence: str) -> None:
    with pytest.raises(InputError, match=re.escape(sentence)):
        read_expression(text, QUANTITIES)


def test_readings_beyond_their_range_count_as_its_bound() -> None:
    assert value("speed / (m/s)", speed=1e6) == 150.0


def test_texts_that_differ_in_spaces_are_the_same() -> None:
    assert read_expression("( a+2*b )", QUANTITIES).text == read_expression("a + (2 * b)", QUANTITIES).text


def test_arrays_of_any_shape_are_computed_at_once() -> None:
    readings = {"a": np.linspace(-3.0, 5.0, 12).reshape(3, 4), "b": np.full((3, 4), 2.0)}
    found = read_expression("a * b if a > 0 else -1", QUANTITIES)(readings)
    assert found.shape == (3, 4)
    assert np.array_equal(found, np.where(readings["a"] > 0, 2.0 * readings["a"], -1.0))


def test_a_pure_number_says_what_else_was_found() -> None:
    with pytest.raises(InputError, match="is in points, expected a pure number"):
        pure_number("score", QUANTITIES)
    assert pure_number("score / points", QUANTITIES).names == ("score",)


@pytest.mark.parametrize("name", ["m", "abs", "two words"])
def test_a_quantity_has_a_name_of_its_own(name: str) -> None:
    with pytest.raises(InputError, match=f"quantity '{name}': expected a name that means nothing else"):
        read_expression("1", {name: Quantity("1", 0.0, 1.0, "")})


@pytest.mark.parametrize(
    ("text", "shown"),
    [("m/s^2", "m/s^2"), ("1/m", "1/m"), ("rad/s", "1/s"), ("1", "a pure number"), ("s m^2/kg", "m^2 s/kg")],
)
def test_a_unit_reads_as_it_is_written(text: str, shown: str) -> None:
    assert str(Unit.parse(text)) == shown


def test_a_unit_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="unit 'm per s!': expected one like m/s"):
        Unit.parse("m per s!")

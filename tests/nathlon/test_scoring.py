"""The scoring against World Athletics' decathlon tables, and through two given marks."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nathlon.selection.battery.scoring import Kind, Scoring

# Constants of the World Athletics Scoring Tables for Combined Events, with the marks (s, cm or m) and points
# of Kevin Mayer's decathlon of 2018, 9126 points.
DECATHLON: list[tuple[Kind, float, float, float, float, int]] = [
    ("time", 25.4347, 18.0, 1.81, 10.55, 963),
    ("distance", 0.14354, 220.0, 1.4, 780.0, 1010),
    ("distance", 51.39, 1.5, 1.05, 16.00, 851),
    ("distance", 0.8465, 75.0, 1.42, 205.0, 850),
    ("time", 1.53775, 82.0, 1.81, 48.42, 889),
    ("time", 5.74352, 28.5, 1.92, 13.75, 1007),
    ("distance", 12.91, 4.0, 1.1, 50.54, 882),
    ("distance", 0.2797, 100.0, 1.35, 545.0, 1051),
    ("distance", 10.14, 7.0, 1.08, 71.90, 918),
    ("time", 0.03768, 480.0, 1.85, 276.11, 705),
]


@pytest.mark.parametrize(("kind", "factor", "threshold", "exponent", "mark", "points"), DECATHLON)
def test_decathlon_events(
    kind: Kind, factor: float, threshold: float, exponent: float, mark: float, points: int
) -> None:
    assert math.floor(Scoring(kind, factor, threshold, exponent).points(mark)) == points


def test_textbook_marks_of_the_decathlon() -> None:
    assert math.floor(Scoring("time", 25.4347, 18.0, 1.81).points(10.00)) == 1096
    assert math.floor(Scoring("distance", 0.14354, 220.0, 1.4).points(800.0)) == 1061


marks = st.floats(1.0, 1000.0)


@given(base=marks, gain=st.floats(0.1, 0.9), exponent=st.floats(1.0, 3.0))
def test_time_scoring_goes_through_its_two_marks(base: float, gain: float, exponent: float) -> None:
    scoring = Scoring.through("time", base, base * (1 - gain), exponent)
    np.testing.assert_allclose(scoring.points([base, base * (1 - gain)]), [500, 1000], rtol=1e-9)
    assert scoring.threshold > base
    assert scoring.points(scoring.threshold + 1) == 0


@given(base=marks, gain=st.floats(0.1, 3.0), exponent=st.floats(1.0, 3.0))
def test_distance_scoring_goes_through_its_two_marks(base: float, gain: float, exponent: float) -> None:
    scoring = Scoring.through("distance", base, base * (1 + gain), exponent)
    np.testing.assert_allclose(scoring.points([base, base * (1 + gain)]), [500, 1000], rtol=1e-9)
    assert scoring.threshold < base
    assert scoring.points(scoring.threshold - 1) == 0


def test_through_recovers_the_constants_of_the_100_m() -> None:
    original = Scoring("time", 25.4347, 18.0, 1.81)
    base, reference = (18.0 - (points / 25.4347) ** (1 / 1.81) for points in (500, 1000))
    recovered = Scoring.through("time", base, reference, 1.81)
    assert recovered.factor == pytest.approx(original.factor)
    assert recovered.threshold == pytest.approx(original.threshold)


def test_a_mark_never_set_scores_nothing() -> None:
    scoring = Scoring.through("time", 100.0, 90.0, 1.8)
    np.testing.assert_array_equal(scoring.points([np.nan, np.inf, 1e6]), 0.0)


@pytest.mark.parametrize(("kind", "base", "reference"), [("time", 90, 100), ("distance", 5, 5)])
def test_a_reference_no_better_than_the_base_is_refused(kind: Kind, base: float, reference: float) -> None:
    with pytest.raises(ValueError, match="reference better than its base"):
        Scoring.through(kind, base, reference, 1.8)

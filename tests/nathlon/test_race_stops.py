"""What a race's result says of stops."""

from __future__ import annotations

import polars as pl
import pytest

from nathlon.api.race import STINTS, RaceResult
from nathlon.arena.stints import DrivenStint, written
from nathlon.commands.racing import _print_stints
from tests.support.race_results import rows

TWO = (DrivenStint("racing-soft", 5, 16.25, 40.0), DrivenStint("racing-hard", 7))


def result(*stints: str | None) -> RaceResult:
    results = rows({"place": list(range(1, len(stints) + 1))}, len(stints)).with_columns(
        pl.Series("stints", stints, pl.String), name=pl.lit("one")
    )
    return RaceResult(results, None, None, "")


def test_every_stint_of_who_has_a_strategist_is_a_row() -> None:
    stints = result(written(TWO), None, written([DrivenStint("racing-hard", 12)])).stints
    assert stints.schema == STINTS
    assert stints.select("place", "compound", "laps", "stood_s", "lane_s").rows() == [
        (1, "racing-soft", 5, 16.25, 40.0),
        (1, "racing-hard", 7, None, None),
        (3, "racing-hard", 12, None, None),
    ]


def test_a_race_without_strategists_has_none() -> None:
    assert result(None, None).stints.is_empty()


def test_stops_are_printed_with_what_they_took(capsys: pytest.CaptureFixture[str]) -> None:
    _print_stints(result(written(TWO)).stints)
    told = capsys.readouterr().out
    assert "16.2" in told
    assert "40.0" in told
    assert "5 racing-soft, 7 racing-hard" in " ".join(told.split())

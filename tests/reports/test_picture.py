"""The picture of the round robin."""

from __future__ import annotations

import warnings
from io import BytesIO
from typing import Any

import polars as pl
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from PIL import Image

from nathlon.arena.results import RANKING
from nathlon.reports.picture import DPI, FIRST, MOST_ROWS, WIDTH_IN, draw_ranking, ranking_picture
from tests.support.selections import ranked

HOSTILE = (
    r"$\frac{1}{0}$ $x",
    "<img src=x onerror=alert(1)>",
    "line\nend\x1b[31m",
    "名前 🏎",
    "\u202egnp.exe",
    "",
    "long" * 200,
)


def table(*rows: dict[str, Any]) -> pl.DataFrame:
    return pl.DataFrame(list(rows), schema=pl.Schema([("name", pl.String()), *RANKING.items()]))


def entrant(name: str, rank: int | None, points: float | None, **more: Any) -> dict[str, Any]:
    return {"name": name, **ranked(name, rank or 0, points), "rank": rank, **more}


def image(ranking: pl.DataFrame) -> Image.Image:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        opened = Image.open(BytesIO(ranking_picture(ranking)))
    opened.load()
    assert opened.format == "PNG"
    return opened


def names(axes: Axes) -> list[str]:
    return [label.get_text() for label in axes.get_yticklabels()]


def test_best_stand_above_with_their_intervals() -> None:
    ranking = table(
        entrant("c", 3, 15.0, barred=True),
        entrant("unraced", None, None),
        entrant("b", 1, 19.0),
        entrant("a", 1, 20.0),
    )
    figure = draw_ranking(ranking)
    [axes] = figure.axes
    assert names(axes) == ["a", "b", "c (barred)", "unraced"]
    assert axes.yaxis_inverted()
    drawn = {
        (int(line.get_ydata()[0]), *map(float, line.get_xdata())): line  # type: ignore[index, arg-type]
        for line in axes.lines
    }
    assert set(drawn) == {(0, 20.0), (0, 19.2, 20.8), (1, 19.0), (1, 18.2, 19.8), (2, 15.0), (2, 14.2, 15.8)}
    fills = [to_hex(drawn[dot].get_markerfacecolor()) for dot in [(0, 20.0), (1, 19.0), (2, 15.0)]]
    assert fills == [FIRST, FIRST, "#ffffff"]
    assert "statistically tied for first" in figure.get_suptitle()


def test_a_lone_first_is_not_called_tied() -> None:
    figure = draw_ranking(table(entrant("a", 1, 20.0), entrant("b", 2, 15.0)))
    assert "alone in rank 1" in figure.get_suptitle()


@pytest.mark.parametrize("rows", [[], [entrant("a", None, None)]], ids=["nobody", "no points"])
def test_nothing_scored_is_said(rows: list[dict[str, Any]]) -> None:
    [axes] = draw_ranking(table(*rows)).axes
    assert [text.get_text() for text in axes.texts] == ["No team race was scored."]
    assert image(table(*rows)).width == WIDTH_IN * DPI


def test_hostile_names_are_shown_as_they_stand() -> None:
    ranking = table(*(entrant(name, 1, 20.0 - place) for place, name in enumerate(HOSTILE)))
    [axes] = draw_ranking(ranking).axes
    shown = names(axes)
    assert shown[:2] == list(HOSTILE[:2])
    assert all(len(name) <= 40 and name.isprintable() for name in shown)
    picture = image(ranking)
    assert picture.width == WIDTH_IN * DPI
    assert 200 < picture.height < 600


def test_a_large_field_is_cut() -> None:
    ranking = table(*(entrant(f"e{place}", place + 1, -float(place)) for place in range(200)))
    figure = draw_ranking(ranking)
    [axes] = figure.axes
    assert names(axes) == [f"e{place}" for place in range(MOST_ROWS)]
    assert f"best {MOST_ROWS} of 200" in figure.get_suptitle()
    assert image(ranking).height < 2000


def test_a_picture_is_light_and_not_empty() -> None:
    picture = image(table(entrant("a", 1, 20.0), entrant("b", 2, float("nan")))).convert("L")
    assert picture.getpixel((0, 0)) == 255
    assert 0.005 < sum(picture.histogram()[:128]) / (picture.width * picture.height) < 0.2

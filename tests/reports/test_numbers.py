"""Numbers as pages write them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from tests.support.page_modules import module


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page()
    yield page
    page.close()


@pytest.mark.parametrize(
    ("call", "written"),
    [
        (("number", None), "–"),
        (("number", 1234.5, 1), "1,234.5"),
        (("number", -0.004, 2), "0.00"),
        (("number", -0.006, 2), "−0.01"),
        (("signed", 0.04), "0.0"),
        (("signed", 0.06), "+0.1"),
        (("signed", -0.06), "−0.1"),
        (("difference", -0.004, 2), "+0.00"),
        (("difference", -0.006, 2), "−0.01"),
        (("percent", 0.125), "13"),
        (("percent", None), "–"),
        (("count", 1, "race"), "1 race"),
        (("count", 2000, "race"), "2,000 races"),
        (("clock", 59.96), "1:00.0"),
        (("clock", 61.04), "1:01.0"),
    ],
)
def test_what_rounds_to_zero_has_no_sign_and_no_second_has_sixty(
    page: Page, call: tuple[Any, ...], written: str
) -> None:
    name, *values = call
    assert page.evaluate(f"{module('numbers.js')}.{name}(...{json.dumps(values)})") == written


@pytest.mark.parametrize(
    ("row", "written"),
    [
        ({"rank": 1, "worst_rank": 1}, "1"),
        ({"rank": 2, "worst_rank": 4}, "2 to 4"),
        ({"rank": 2, "worst_rank": None}, "from 2"),
        ({"rank": None}, "–"),
    ],
)
def test_a_rank_is_the_range_of_those_that_are_possible(
    page: Page, row: dict[str, int | None], written: str
) -> None:
    assert page.evaluate(f"{module('rank.js')}.rankText({json.dumps(row)})") == written

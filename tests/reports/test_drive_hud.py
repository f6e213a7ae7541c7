"""What stands over the picture of a test drive."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.support.page_modules import module

PARTS = "".join(f"<div id='{name}'></div>" for name in ("place", "times", "order", "car", "news", "lights"))
TOLD = """([zones, progress, penalty]) => {
  const cars = [{ progress, speed: 0, throttle: 0, brake: 0, place: 1, doing: "driving" }];
  const none = { lap: NaN, lastLap: NaN, bestLap: NaN };
  const frame = { laps: 0, gear: 1, rpm: 0, steering: 0, warnings: 0, penalty, cars, ...none };
  const race = { choice: { laps: 1 }, cars: [{ name: "driver", colour: "#fff" }] };
  const scene = { lap: 1000, rpm: 7000, ground: [[], [], zones] };
  const hud = HUD({ race, scene, reference: { delta: () => null } });
  hud.draw(frame, 0, 1000);
  return [...document.querySelectorAll(".row:has(.zone)")].map((row) => row.lastChild.textContent);
}"""


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page()
    page.set_content(PARTS)
    yield page
    page.close()


@pytest.mark.parametrize(
    ("progress", "penalty", "told"),
    [
        (100.0, 0.0, []),
        (300.0, 0.0, ["in 200 m"]),
        (550.0, 0.0, ["here"]),
        (-450.0, 0.0, ["here"]),
        (1650.0, 0.0, []),
        (1650.0, 3.0, ["in 850 m"]),
    ],
)
def test_penalty_zones_have_a_key_in_sight_and_while_a_penalty_is_to_be_served(
    page: Page, progress: float, penalty: float, told: list[str]
) -> None:
    zones = [int(50 <= row < 60) for row in range(100)]
    script = TOLD.replace("HUD", f"{module('drive/hud.js')}.newHud")
    assert page.evaluate(script, [zones, progress, penalty]) == told
    assert page.evaluate(script, [[0] * 100, progress, penalty]) == [], "a circuit without any"

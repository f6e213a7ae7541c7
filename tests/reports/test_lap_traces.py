"""The coach's charts of a lap beside another, where the other is not known all the way."""

from __future__ import annotations

import json

from playwright.sync_api import Browser

from tests.support.page_modules import module


def lap(places: list[float], speed: float) -> dict[str, list[float]]:
    same = [0.0] * len(places)
    return {
        "place": places,
        "time_s": [one / speed for one in places],
        "speed": same,
        "pedal": same,
        "lateral": same,
    }


def test_time_lost_is_drawn_only_where_both_laps_are_known(browser: Browser) -> None:
    page = browser.new_page()
    laps = {"own": lap([0.0, 10.0, 20.0], 10.0), "other": lap([0.0, 10.0], 20.0), "edited": []}
    drawn, told, beyond = page.evaluate(
        f"""() => {{
      const traces = {module("coach/traces.js")}.lapTraces(document.body, {json.dumps(laps)}, () => {{}});
      traces.show(0, 20);
      const [chart] = document.querySelectorAll(".trace");
      const text = (place) => {{ traces.mark(place); return chart.querySelector("output.own").textContent; }};
      return [chart.querySelector("path.own").getAttribute("d").match(/[ML]/g).length, text(5), text(15)];
    }}"""
    )
    page.close()
    assert (drawn, told, beyond) == (2, "+0.250", "")

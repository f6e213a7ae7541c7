"""What the three-dimensional scene is made of: cars, what they do to the picture, marks of tyres, dust."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from nathlon.reports.player import write_player
from nathlon.sim.car import load_car
from tests.support.page_modules import module
from tests.support.race_logs import oval_race

CARS = ("gt3", "coupe", "prototype")
PROBES = (Path(__file__).parent.parent / "support" / "scene_probes.js").read_text("utf-8")
MODELS, EFFECTS, PACE, VIEW, RECORDING = (
    module(path)
    for path in (
        *("scene3d/car_models.js", "scene3d/effects.js", "scene3d/pace.js", "scene3d/view.js"),
        "race/recording.js",
    )
)


@pytest.fixture(scope="module")
def page(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    path = tmp_path_factory.mktemp("scene") / "race.html"
    write_player(oval_race(cars=2, duration_s=5.0), path)
    page = browser.new_page(viewport={"width": 400, "height": 300})
    page.goto(path.as_uri())
    page.wait_for_selector("body[data-ready]")
    yield page
    page.close()


def asked(page: Page, probe: str) -> Any:
    return page.evaluate(f"async () => {{ {PROBES}\nreturn {probe}; }}")


@pytest.mark.parametrize("name", CARS)
def test_a_car_has_its_size_and_few_triangles(page: Page, name: str) -> None:
    body = load_car(name).body
    told = asked(page, f"triangles({MODELS}, '{name}', {body.length_m}, {body.width_m})")
    assert 1000 < told["triangles"] < 5000
    assert told["reach"][0] == pytest.approx(body.length_m / 2, abs=0.2)
    assert told["reach"][1] == pytest.approx(body.width_m / 2, abs=0.06)
    assert 0.9 < told["reach"][2] < 1.45
    assert told["tail"] > 0.29, "rear wheels are seen from behind"
    assert [(x > 0, y > 0) for x, y, _ in told["wheels"]] == [
        (a, b) for a in (True, False) for b in (True, False)
    ]


def test_what_a_car_does_is_seen(page: Page) -> None:
    told = asked(page, f"pixels({VIEW}, {RECORDING})")
    assert told["before"] == 0, "marks are there once they are left"
    assert {name for name, pixels in told.items() if pixels > 15} == {*told} - {"before"}, told


def test_slow_pictures_become_coarser_until_they_come_in_time(page: Page) -> None:
    slow, quick, hiccups = [90] * 10, [16] * 60, [16, 16, 900] * 20
    coarser = asked(page, f"fineness({PACE}, {[*slow * 5, None, *slow]})".replace("None", "null"))
    assert coarser[0] == 1.0
    assert sorted(coarser[:50], reverse=True) == coarser[:50]
    assert 0.3 < coarser[49] < 0.5, "not more than is worth seeing"
    assert coarser[50] == 1.0, "what stands still is sharp"
    assert set(asked(page, f"fineness({PACE}, {hiccups})")) == {1.0}, "single slow pictures are no reason"
    again = asked(page, f"fineness({PACE}, {[*slow * 2, *quick, *([16] * 1300)]})")
    assert again[79] < 1.0, "it does not waver"
    assert again[-1] == 1.0, "and becomes fine again"


def test_tyres_that_slide_leave_marks_and_wheels_beside_the_road_raise_dust(page: Page) -> None:
    told = asked(page, f"traces({EFFECTS}, {RECORDING})")
    assert (told["straight"], told["sideways"], told["slow"], told["marks"]) == (False, True, False, 2)
    assert told["road"] is None
    assert told["beside"]["colour"] != told["smoke"] is not None

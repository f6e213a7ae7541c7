"""The page of a test drive in a browser: driven by its own keys and by a gamepad, and looked at."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from benchmarks.steered_page import LedClock
from nathlon.arena.race_log import Incident
from nathlon.lab.drive.difficulty import LEVELS
from nathlon.lab.drive.room import Room
from nathlon.lab.drive.server import DriveServer
from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.data_file import DATA
from tests.support.driven_page import MAP, Drive, serious
from tests.support.drives import served
from tests.support.page_modules import module

PAD = """
window.pad = { id: "Wheel (Vendor: 046d)", index: 0, connected: true, mapping: MAPPING, axes: AXES,
  buttons: Array.from({ length: 8 }, () => ({ value: 0, pressed: false })) };
navigator.getGamepads = () => [window.pad];
"""
GO_ON_BRAKING = """async () => {
  const pause = document.getElementById("pause");
  [...pause.querySelectorAll("button")].find((button) => button.textContent === "Go on").focus();
  document.activeElement.click();
  while (pause.open) await new Promise((done) => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = done;
    port2.postMessage(null);
  });
  document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { code: "ArrowDown", bubbles: true }));
}"""
"""Script that leaves the pause and presses a key before the page is drawn without it."""


@pytest.fixture
def drives(tmp_path: Path) -> Iterator[tuple[DriveServer, Room]]:
    with served(tmp_path) as both:
        yield both


def steps(seconds: float) -> int:
    return round(seconds / DYNAMICS_DT)


def test_a_race_is_driven_with_keys(browser: Browser, tmp_path: Path) -> None:
    """The world makes the steps that it is given: a browser may take its time for a picture."""
    clock = LedClock()
    with served(tmp_path, clock=clock) as both:
        race_with_keys(Drive(browser, *both), clock)


def race_with_keys(drive: Drive, clock: LedClock) -> None:
    assert serious(drive.page) == []
    drive.picture("menu")
    # A choice is wide enough for its longest text, beside the arrow.
    cut = """() => [...document.querySelectorAll('#choice select')].filter((one) => {
      const pen = document.createElement('canvas').getContext('2d');
      pen.font = getComputedStyle(one).font;
      const longest = Math.max(...[...one.options].map(({ text }) => pen.measureText(text).width));
      return longest > one.clientWidth - 44;
    }).map(({ name }) => name)"""
    for width in (1280, 1440):
        drive.page.set_viewport_size({"width": width, "height": 720})
        assert drive.page.evaluate(cut) == []
    drive.page.set_viewport_size({"width": 1280, "height": 720})
    drive.begin(name="Ada", laps="1", cars="4", seat="2")
    keyboard = drive.page.keyboard
    keyboard.down("ArrowUp")
    drive.heard(True, 0.0, 1.0, 0.0)
    clock.give(steps(4.0))
    drive.until("Number(document.querySelector('#car b').textContent) > 40")
    assert drive.page.locator("#lights").inner_text() in ("GO", "")
    drive.picture("chase")
    keyboard.down("KeyA")
    drive.heard(True, 1.0, 1.0, 0.0)
    clock.give(steps(0.5))
    drive.until("Number(document.querySelector('#car svg rect:last-child').getAttribute('x')) < 96")
    keyboard.up("KeyA")
    keyboard.up("ArrowUp")
    for name in ("cockpit", "map"):
        keyboard.press("c")
        drive.page.wait_for_timeout(200)
        drive.picture(name)
    drive.page.locator("#map").wait_for(state="visible")
    keyboard.press("p")
    drive.until("document.getElementById('pause').open")
    assert serious(drive.page) == []
    drive.picture("pause")
    heat = drive.room.heat
    assert heat is not None
    drive.page.click("#pause >> text=Steering aid")
    drive.page.evaluate(GO_ON_BRAKING)
    # The aids are told before this.
    drive.heard(True, 0.0, 0.0, 1.0)
    assert not heat.aids.steering
    assert heat.aids.pedals
    clock.give(steps(8.0))
    # At rest the brake that is still held drives back, at 4 m/s.
    drive.until("Number(document.querySelector('#car b').textContent) < 16")
    keyboard.up("ArrowDown")
    clock.let_go()
    # Out as stuck, and the race goes to its end without the person.
    drive.until("document.getElementById('result').open")
    drive.picture("result")
    assert drive.page.locator("#result h2").inner_text() == "Your race ended: stuck"
    assert drive.page.locator("#result .again canvas").is_visible(), "the race just driven is played"
    assert "driver:pace" not in drive.page.locator("#result .again").inner_text()
    places = drive.page.evaluate(f"[1, 2, 3, 11].map({module('drive/words.js')}.ordinal)")
    assert places == ["1st", "2nd", "3rd", "11th"]
    assert drive.page.locator("#result tr.own td").nth(1).inner_text() == "Ada"
    assert drive.room.kept[-1].recording.exists()
    assert Path(drive.page.locator("#result code").nth(1).inner_text()).exists()
    drive.page.click("#result >> text=Another race")
    drive.until("!document.getElementById('menu').hidden")
    drive.close()


def test_a_circuit_of_one_s_own_is_offered_by_its_folder(browser: Browser, tmp_path: Path) -> None:
    shutil.copytree(DATA / "circuits" / "lindenring", tmp_path / "grand-prix-7")
    with served(tmp_path / "drives", circuit=str(tmp_path / "grand-prix-7" / "circuit.toml")) as both:
        drive = Drive(browser, *both)
        offered = drive.page.locator("[name=circuit] option").all_inner_texts()
        drive.close()
    assert offered == ["Grand Prix 7", "Grandes Landes", "Lindenring", "Porto Sereno"]


def test_a_race_is_driven_with_a_standard_gamepad(browser: Browser, tmp_path: Path) -> None:
    clock = LedClock()
    with served(tmp_path, clock=clock) as both:
        pad = PAD.replace("MAPPING", '"standard"').replace("AXES", "[0, 0, 0, 0]")
        drive = Drive(browser, *both, script=pad)
        drive.page.select_option("[name=device]", "Wheel (Vendor: 046d)")
        drive.begin(cars="1", seat="1")
        drive.page.evaluate("() => { pad.buttons[7].value = 1; pad.axes[0] = -0.03; }")
        drive.heard(False, 0.0, 1.0, 0.0)
        clock.give(steps(3.0))
        drive.until("Number(document.querySelector('#car b').textContent) > 30")
        drive.page.evaluate("() => { pad.buttons[7].value = 0.25; pad.axes[0] = -1; }")
        drive.heard(False, 1.0, 0.25, 0.0)
        clock.give(steps(0.5))
        drive.until("Number(document.querySelector('#car svg rect:last-child').getAttribute('x')) < 96")
        drive.page.keyboard.press("r")
        clock.let_go()
        drive.until("Number(document.querySelector('#car b').textContent) < 1")
        drive.close()


def test_a_wheel_is_calibrated_once_and_known_again(
    browser: Browser, drives: tuple[DriveServer, Room]
) -> None:
    """Pedals of a wheel rest at +1, and its axes have any order."""
    pad = PAD.replace("MAPPING", '""').replace("AXES", "[1, 0, 1]")
    drive = Drive(browser, *drives, script=pad)
    drive.page.select_option("[name=device]", "Wheel (Vendor: 046d)")
    drive.page.click("text=Calibrate")
    for axes in ("[1, -0.9, 1]", "[1, 0.9, 1]", "[1, 0, -1]", "[-1, 0, 1]"):
        drive.page.evaluate(f"() => {{ pad.axes = {axes}; }}")
        drive.page.click("text=Noted")
    drive.until("!document.getElementById('calibrate').open")
    drive.page.reload()
    drive.until("document.querySelector('#choice button.first')")
    inputs = f"{module('drive/inputs.js')}.newInputs(() => {{}})"
    read = f"([x, y, z]) => {{ pad.axes = [x, y, z]; return {inputs}.read(); }}"
    assert drive.page.evaluate(read, [1, -0.9, 1])["steering"] == pytest.approx(1.0)
    assert drive.page.evaluate(read, [1, 0.45, 1])["steering"] == pytest.approx(-0.5)
    assert drive.page.evaluate(read, [1, 0, 0])["throttle"] == pytest.approx(0.5)
    assert drive.page.evaluate(read, [-0.5, 0, 1])["brake"] == pytest.approx(0.75)
    drive.close()


def test_what_is_drawn_lies_between_frames(browser: Browser, drives: tuple[DriveServer, Room]) -> None:
    """With clocks of the test's own: frames come unevenly, and are drawn two and a half ticks late."""
    drive = Drive(browser, *drives)
    drawn = drive.page.evaluate(
        f"() => {{ const {{ newPlayback }} = {module('drive/link.js')};"
        """
      const playback = newPlayback();
      const car = (x, yaw) => ({ x, y: 0, z: 0, yaw, pitch: 0, roll: 0, speed: 60, progress: x });
      const late = [0, 0.004, 0, 0.012, 0, 0, 0.009];
      const seen = [];
      let sent = 0;
      for (let now = 100; now < 101; now += 0.004) {
        while (100 + sent / 60 + late[sent % 7] <= now) {
          const yaw = Math.PI - 0.05 + 0.01 * sent;
          const cars = [car(sent, yaw > Math.PI ? yaw - 2 * Math.PI : yaw)];
          playback.take({ time: sent / 60, phase: "racing", steering: 0, rpm: 0, cars }, now);
          sent += 1;
        }
        const frame = playback.at(now);
        seen.push([now - 100, frame.cars[0].x / 60, frame.cars[0].yaw]);
      }
      return seen;
    }"""
    )
    late = [now - shown for now, shown, _ in drawn if now > 0.1]
    assert max(late) - min(late) < 0.006
    assert sum(late) / len(late) == pytest.approx(2.5 / 60, abs=0.005)
    assert all(b[1] >= a[1] for a, b in pairwise(drawn))
    assert all(abs(yaw) > 2.5 or now > 0.9 for now, _, yaw in drawn)
    drive.close()


def test_a_difficulty_is_told_with_all_its_paces(browser: Browser, drives: tuple[DriveServer, Room]) -> None:
    drive = Drive(browser, *drives, script=MAP)
    drive.page.select_option("[name=difficulty]", "match")
    assert not drive.page.locator("[name=opponent]").first.is_visible()
    drive.page.click("#choice button.first")
    drive.until("document.getElementById('refused').textContent.includes('has finished no drive here yet')")
    drive.page.select_option("[name=difficulty]", "beginner")
    drive.page.select_option("[name=temper]", "calm")
    drive.begin(cars="3", seat="3")
    drive.until("document.getElementById('news').textContent.includes('at 74.0 to 84.0 % of its pace, calm')")
    drive.until("document.getElementById('order').textContent.includes('Built-in driver, 84 % pace, calm')")
    assert drive.room.heat is not None
    ahead, other, own = drive.room.heat.plan.grid
    assert (ahead, other) == tuple(f"driver:pace={pace},temper=calm" for pace in ("0.8400", "0.7400"))
    told = Incident(1.0, "contact", (2, 0), f"3 {own} runs into the rear of 1 {ahead}")
    drive.room._on_loop(drive.room._on_incident, told)
    drive.until("document.getElementById('news').textContent.includes('1 Built-in driver, 84 % pace, calm')")
    # Who has chosen nothing yet begins with what the server says.
    drive.page.evaluate(
        f"""choices => {{
            localStorage.clear();
            {module("drive/menu.js")}.newMenu({{ choices, inputs: {{ device: "keys" }}, onGo() {{}} }});
        }}""",
        {
            **{"circuits": ["lindenring"], "cars": ["gt3"], "opponents": [], "most_laps": 9, "most_cars": 9},
            **{"blind": None, "difficulty": None, "temper": None, "levels": LEVELS, "unchosen": "beginner"},
        },
    )
    assert drive.page.locator("[name=difficulty]").input_value() == "beginner"
    drive.close()

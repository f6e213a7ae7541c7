"""A scripted person at the page of a test drive: in a real browser, by its own keys or a gamepad.

The world waits for them: it makes its next steps once the server has heard what they do now. So a slow
machine changes nothing but the time that it takes.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from playwright.sync_api import Page

from benchmarks.scripted_drivers import KEY_PRESS, KEYS, WHEEL, ScriptedDriver, Style
from nathlon.lab.drive.aids import Controls
from nathlon.lab.drive.clock import Clock
from nathlon.lab.drive.heat import Heat
from nathlon.lab.drive.room import Room

PAD = "Scripted pad"
PADS = f"""
window.pad = {{ id: "{PAD}", index: 0, connected: true, mapping: "standard", axes: [0, 0, 0, 0],
  buttons: Array.from({{ length: 17 }}, () => ({{ value: 0, pressed: false }})) }};
navigator.getGamepads = () => [window.pad];
"""
"""Script of a page that has a gamepad of the usual layout; no browser lets one be plugged in."""
DEAD, CURVE = 0.06, 1.5
"""Of the stick, as the page reads it."""
STEPS = 4
"""Dynamics steps between two looks with a gamepad; with keys, `KEY_PRESS`."""
HEARD = 1e-5
"""Within which what the server has heard is what was done."""
PATIENCE_S = 60.0


class LedClock(Clock):
    """A clock whose world makes the steps that it is given, and no others."""

    def __init__(self) -> None:
        super().__init__(sleep=lambda seconds: None)
        self._changed = threading.Condition()
        self._steps, self._waits, self._free = 0, False, False

    def wait(self) -> None:
        """Wait for a step."""
        with self._changed:
            self._waits = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._steps > 0 or self._free)
            self._steps -= 1
            self._waits = self._steps > 0

    def give(self, steps: int) -> None:
        """Give some steps, and wait until they are made."""
        with self._changed:
            self._steps, self._waits = steps, False
            self._changed.notify_all()
            assert self._changed.wait_for(lambda: self._waits and self._steps <= 0, PATIENCE_S)

    def let_go(self) -> None:
        """Let the world run as fast as it can, from now on."""
        with self._changed:
            self._free = True
            self._changed.notify_all()


class Done(NamedTuple):
    """What a scripted person has driven.

    Attributes:
        time_s: since the start.
        progress_m: since the line.
        off_course_s, wall_s: beside the course, and at a wall.
        turns: changes of what they did.
    """

    time_s: float
    progress_m: float
    off_course_s: float
    wall_s: float
    turns: int


def steer(page: Page, room: Room, clock: LedClock, style: Style, until_m: float) -> Done:
    """Drive a race alone that has begun, through the page's own inputs.

    Args:
        page: on which it is driven; with PADS for a style without keys, and the pad chosen.
        room: of the server.
        clock: of its race.
        style: how.
        until_m: metres from the line, before the race ends.
    """
    heat = room.heat
    assert heat is not None, "a race is under way"
    choice, hands = heat.plan.choice, _Keys(page) if style.keys else _Pad(page)
    driver = ScriptedDriver(choice.circuit, choice.car, style)
    clock.give(1)
    steps = KEY_PRESS if style.keys else STEPS
    for own in _looks(heat, clock, steps, until_m):
        controls = driver.act(own)
        # They hold it through all of the steps.
        for _ in range(steps - 1):
            driver.act(own)
        hands.do(controls)
        _heard(room, controls)
    world = heat.world
    assert world is not None, "it was driven"
    own = world.state[0, choice.seat - 1]
    off_course_s, wall_s = float(own["off_course_s"]), float(own["wall_s"])
    return Done(float(world.time[0]), float(own["progress"]), off_course_s, wall_s, hands.turns)


def _looks(heat: Heat, clock: LedClock, steps: int, until_m: float) -> Iterator[np.void]:
    """The own car every some steps."""
    world, car = heat.world, heat.plan.choice.seat - 1
    assert world is not None, "it has begun"
    while world.state["driving"][0, car] and world.state["progress"][0, car] < until_m:
        yield world.state[0, car].copy()
        clock.give(steps)


def _heard(room: Room, controls: Controls) -> None:
    """Wait until the server knows what is done."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        now = room.buffer.latest.controls
        if now.keys == controls.keys and math.dist(now[1:], controls[1:]) < HEARD:
            return
        time.sleep(0.001)
    raise TimeoutError(f"the server has heard {room.buffer.latest.controls}, expected {controls}")


class _Keys:
    """The page's keys."""

    def __init__(self, page: Page) -> None:
        self._keyboard, self._down = page.keyboard, set[str]()
        self.turns = 0

    def do(self, controls: Controls) -> None:
        pressed = {
            "ArrowLeft": controls.steering > 0.0,
            "ArrowRight": controls.steering < 0.0,
            "ArrowUp": controls.throttle > 0.0,
            "ArrowDown": controls.brake > 0.0,
        }
        for key, down in pressed.items():
            if down != (key in self._down):
                self.turns += 1
                (self._keyboard.down if down else self._keyboard.up)(key)
                (self._down.add if down else self._down.discard)(key)


class _Pad:
    """The page's gamepad."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._last: Any = None
        self.turns = 0

    def do(self, controls: Controls) -> None:
        stick = 0.0
        if controls.steering:
            stick = -math.copysign(
                DEAD + (1.0 - DEAD) * abs(controls.steering) ** (1.0 / CURVE), controls.steering
            )
        now = [stick, controls.throttle, controls.brake]
        self.turns += now != self._last
        self._last = now
        self._page.evaluate(
            "([x, throttle, brake]) => { pad.axes = [x, 0, 0, 0];"
            " [pad.buttons[7].value, pad.buttons[6].value] = [throttle, brake]; }",
            now,
        )


STYLES = {"keys": KEYS, "pad": WHEEL}
"""How each is driven."""

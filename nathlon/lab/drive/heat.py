"""A race with a person in it, on a thread of its own."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.incidents import Alarm, IncidentWatch
from nathlon.arena.race_log import Incident, RaceLog
from nathlon.arena.recorder import record_races
from nathlon.lab.drive.aids import AidedCar, Aids
from nathlon.lab.drive.choice import DrivePlan
from nathlon.lab.drive.clock import Clock
from nathlon.lab.drive.frames import COUNTDOWN, OVER, PAUSED, RACING, frame
from nathlon.lab.drive.input_buffer import InputBuffer
from nathlon.lab.drive.mark import MOST_MARKS, Mark, mark
from nathlon.policies.apart import PolicyApart
from nathlon.policies.sources.human import Person
from nathlon.sim.car import load_car
from nathlon.sim.rules import load_rules
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.world import World

log = logging.getLogger(__name__)

COUNTDOWN_S = 4.0
"""From the first picture of the grid to the start."""
LOOK_S = 0.05
"""Between two pictures of a race that stands still."""


class DrivenHeat(NamedTuple):
    """A race that was driven to its end.

    Attributes:
        plan: the race.
        controls: (steps, 2) float32, what the person's car was told in each.
        results: RESULTS of its match.
        log: of the race.
        marks: moments that the person marked.
    """

    plan: DrivePlan
    controls: NDArray[np.float32]
    results: pl.DataFrame
    log: RaceLog
    marks: tuple[Mark, ...] = ()


class _Left(Exception):
    """The person has left the race."""


class Heat:
    """One race as it is driven.

    The race runner runs it as every race, but no faster than the time of day while the person drives.

    Attributes:
        clock: of the world.
        world: in which it is driven; None before it is.

    Args:
        plan: the race.
        buffer: where the person's inputs arrive.
        on_frame: told how the race stands, as a binary frame; on the race's thread, as all of these.
        on_incident: told what the stewards note.
        on_mark: told what the person marks.
        on_end: told of the race when it has ended; with None if the person has left it or it has failed.
        clock: of the world.
    """

    def __init__(
        self,
        plan: DrivePlan,
        buffer: InputBuffer,
        on_frame: Callable[[bytes], None],
        on_incident: Callable[[Incident], None],
        on_mark: Callable[[Mark], None],
        on_end: Callable[[DrivenHeat | None], None],
        clock: Clock,
    ) -> None:
        self.plan, self.clock = plan, clock
        self._buffer, self._on_frame, self._on_incident, self._on_end = buffer, on_frame, on_incident, on_end
        self._on_mark = on_mark
        self._car = plan.choice.seat - 1
        self._aided = AidedCar(load_car(plan.choice.car), plan.choice.aids)
        self._controls: list[tuple[float, float]] = []
        self._number, self._over = 0, False
        self.world: World | None = None
        self._marks: list[Mark] = []
        self._running, self._left, self._marking = threading.Event(), threading.Event(), threading.Event()
        self._running.set()
        track = load_track(plan.choice.circuit)
        rules = load_rules(load_scenario(plan.choice.scenario).rules)
        self._lap_m = track.length
        self._guests = {
            entrant: policy for entrant, policy in enumerate(plan.policies) if isinstance(policy, PolicyApart)
        }
        self._stewards, self._alarm = IncidentWatch(0, plan.grid, rules, track), Alarm([0])
        self._thread = threading.Thread(target=self.run, name="race", daemon=True)

    def start(self) -> None:
        """Put the cars on the grid, and start after a countdown."""
        self._thread.start()

    def pause(self) -> None:
        """Stand still before the next step, or keep the countdown from going on."""
        self._running.clear()

    def go_on(self) -> None:
        """End a pause."""
        self._running.set()

    def mark(self) -> None:
        """Mark the moment after the next step."""
        self._marking.set()

    def leave(self) -> None:
        """End the race here, and wait until it has; nothing of it is kept."""
        self._left.set()
        self._running.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    @property
    def aids(self) -> Aids:
        """Those that are on."""
        return self._aided.aids

    @aids.setter
    def aids(self, aids: Aids) -> None:
        self._aided.aids = aids

    def run(self) -> None:
        """Drive the race on this thread, to its end."""
        driven: DrivenHeat | None = None
        try:
            driven = self._drive()
        except _Left:
            pass
        # Whatever goes wrong in a race must not end the server without a word.
        except Exception:
            log.exception("the race has failed")
        for guest in self._guests.values():
            guest.close()
        self._on_end(driven)

    def _drive(self) -> DrivenHeat:
        plan = self.plan
        person = Person(self._hands, plan.choice.name)
        recorded = record_races(plan.match, [*plan.policies, person], [0], plan.names, observer=self._observe)
        controls = np.array(self._controls, np.float32).reshape(-1, 2)
        return DrivenHeat(plan, controls, recorded.results, recorded.logs[0], tuple(self._marks))

    def _hands(self, step: int) -> tuple[float, float]:
        """What the person does now, as the race runner asks; see `nathlon.policies.sources.human`."""
        assert self.world is not None, "it is looked at before anybody acts"
        noted = self._buffer.latest
        self._number = noted.number
        done = self._aided.act(noted.controls, self.world.state[0, self._car])
        self._controls.append(done)
        return done

    def _observe(self, world: World) -> None:
        """Show the race after a step, and wait until the next one is due."""
        first, self.world = self.world is None, world
        if self._alarm(world)[0]:
            told = len(self._stewards.incidents)
            self._stewards.see(world)
            for incident in self._stewards.incidents[told:]:
                self._on_incident(incident)
        self._note_failures(world)
        if self._left.is_set():
            raise _Left
        if not world.state["driving"][0, self._car]:
            # The others drive on as fast as they can be computed: nobody looks.
            if not self._over:
                self._over = True
                self._show(OVER)
            return
        if first:
            self._count_down()
        self._show(RACING)
        if self._marking.is_set():
            self._note_mark(world)
        if not self._running.is_set():
            self._stand_still()
        self.clock.wait()

    def _note_failures(self, world: World) -> None:
        """Tell of guests that have failed since the last look: the race goes on without them."""
        failed = [entrant for entrant, guest in self._guests.items() if guest.failure]
        for entrant in failed:
            seats = self.plan.match.races[0].seats
            cars = tuple(car for car, seat in enumerate(seats) if seat.entrant == entrant)
            text = f"{self.plan.names[entrant]}: {self._guests[entrant].failure}, and is out"
            self._on_incident(Incident(float(world.time[0]), "ending", cars, text))
            del self._guests[entrant]

    def _note_mark(self, world: World) -> None:
        self._marking.clear()
        if len(self._marks) < MOST_MARKS:
            self._marks.append(mark(world, self._car, self._lap_m))
            self._on_mark(self._marks[-1])

    def _show(self, phase: int) -> None:
        assert self.world is not None, "there is nothing to show"
        self._on_frame(frame(self.world, self._car, self._number, phase))

    def _count_down(self) -> None:
        for _ in range(round(COUNTDOWN_S / LOOK_S)):
            self._show(COUNTDOWN)
            while not self._running.wait(LOOK_S):
                self._show(COUNTDOWN)
            self.clock.rest(LOOK_S)
            if self._left.is_set():
                break
        self.clock.start()

    def _stand_still(self) -> None:
        while not self._running.wait(LOOK_S):
            self._show(PAUSED)
        if self._left.is_set():
            raise _Left
        self.clock.start()

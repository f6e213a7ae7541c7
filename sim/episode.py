"""Episodes: races of a scenario side by side, which all environments and rollouts share."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box, Dict, Space
from numpy.typing import NDArray

from nathlon.sim.car import load_car
from nathlon.sim.clock import DYNAMICS_HZ
from nathlon.sim.errors import InputError
from nathlon.sim.observation import NUMBERS, PICTURE, ObservationSpec
from nathlon.sim.reaction import Perception
from nathlon.sim.scenario import Scenario, load_scenario
from nathlon.sim.state import CONTACT, Races
from nathlon.sim.timing import gaps
from nathlon.sim.track import load_track
from nathlon.sim.world import World

FLAGS = ("off_course", "wall_contact", "car_contact")

STUCK_S = 15.0
"""A car at rest for so long is out of the race."""

Facts = Mapping[str, NDArray[Any]]


def end_runs(
    world: World,
    endings: NDArray[np.str_],
    time_s: NDArray[np.float64] | float,
    stuck_s: float = STUCK_S,
) -> None:
    """Note how runs ended in the last step, and take cars that are stuck or out of time off the circuit.

    Args:
        world: the world after a step.
        endings: (races, cars) str, changed in place from '' to 'finished', 'stuck' or 'time_up'.
        time_s: time at which a run ends for all, s; one number, or (races,).
        stuck_s: a car at rest for longer is stuck, s.
    """
    state = world.state
    finished, stuck = ~state["driving"], state["stationary_s"] > stuck_s
    ended = (endings == "") & (finished | stuck | (world.time >= time_s)[:, None])
    if not ended.any():
        return
    endings[ended] = np.where(finished, "finished", np.where(stuck, "stuck", "time_up"))[ended]
    state["driving"] &= ~ended


def observation_space(spec: ObservationSpec) -> Space[Any]:
    """Space of one car's observation: a Box, with a camera a Dict of `picture` and `sensors`.

    Numbers are standardised, but not bounded: a spinning car leaves any range.
    """
    numbers = Box(-np.inf, np.inf, (spec.size,), np.float32)
    if spec.camera is None:
        return numbers
    return Dict({PICTURE: Box(0, 255, spec.camera.shape, np.uint8), NUMBERS: numbers})


def in_space(seen: Any) -> Any:
    """An element of the observation space, or a batch of it, from a row or rows of what was seen."""
    if seen.dtype.names is None:
        return seen
    return {name: np.ascontiguousarray(seen[name]) for name in (PICTURE, NUMBERS)}


def action_space() -> Box[np.float32]:
    """Space of one car's action: throttle (+) or brake (-), steering (+ is left)."""
    return Box(-1.0, 1.0, (2,), np.float32)


class Moment(NamedTuple):
    """All that decides how races go on from a moment of them: copies, one row a race.

    Attributes:
        arrays: as of `World.arrays`.
        endings: as of `Episodes`.
    """

    arrays: Races
    endings: NDArray[np.str_]

    @property
    def state(self) -> NDArray[np.void]:
        """CAR_STATE of the cars."""
        return self.arrays.cars

    def of(self, race: int) -> Moment:
        """A copy of the moment of one race, without the dimension of races."""
        return Moment(Races._make(array[race].copy() for array in self.arrays), self.endings[race].copy())


class View:
    """What some cars of the episodes see; made by `Episodes.watch`.

    Attributes:
        seen: (n, ...) standardised observations as of `World.observe`, as late as the scenario has them.
    """

    seen: NDArray[Any]

    def __init__(self, perception: Perception) -> None:
        self._perception = perception

    def forget(self, races: Collection[int]) -> None:
        """Have some races begin with what is seen next."""
        self._perception.forget(races)

    def look(self, world: World) -> None:
        """See the present; to be called once a tick."""
        self.seen = self._perception.see(world)


class Episodes:
    """Races of one scenario, each started again and again.

    Attributes:
        scenario: what they are races of.
        world: the world, read it freely. After a step its flags tell of the whole step.
        endings: (races, cars) str, how each run ended: 'finished', 'stuck' or 'time_up'; '' while it lasts.
        limit_s: (races,) time at which each race ends, the scenario's unless changed.
        step_s: length of a step, s.
        contacts, contact_races: (n,) CONTACT, those that began in the last step, and (n,) their races.
    """

    def __init__(
        self,
        circuit: str,
        car: str,
        scenario: str | Scenario,
        races: int = 1,
        threads: int = 1,
        stuck_s: float = STUCK_S,
    ) -> None:
        """Races yet to be started.

        Args:
            circuit, car, scenario: shipped names or paths of `.toml` files, or the scenario itself.
            races: how many.
            threads: on which a step works; the results do not depend on them.
            stuck_s: a car at rest for longer is out, s.

        Raises:
            InputError: if a name is unknown, a file is wrong, or the cars act at different rates.
        """
        self.scenario = load_scenario(scenario) if isinstance(scenario, str) else scenario
        self._reaction = self.scenario.reaction
        if len(set(self._reaction.period)) > 1:
            raise InputError(
                f"scenario {self.scenario.name!r}: action_hz differs between cars, expected one rate"
            )
        self._track = load_track(circuit)
        self.world = self.scenario.world(self._track, load_car(car), races, threads)
        self.endings = np.full(self.world.state.shape, "", dtype="U8")
        self.limit_s = np.full(races, self.scenario.time_s)
        self.step_s = float(self._reaction.period[0] / DYNAMICS_HZ)
        self._stuck_s = stuck_s
        self._views: list[View] = []
        self.contacts = np.zeros(0, CONTACT)
        self.contact_races = np.zeros(0, np.int64)

    def watch(self, spec: ObservationSpec, races: NDArray[np.int64], cars: NDArray[np.int64]) -> View:
        """The view of some cars, (n,) indices, kept up to date from the next start on."""
        view = View(Perception(spec, races, cars, self._reaction))
        self._views.append(view)
        return view

    def start(
        self,
        races: Collection[int],
        rngs: Iterable[np.random.Generator],
        moments: Mapping[int, Moment] | None = None,
    ) -> None:
        """Put all cars of some races at starts that the scenario draws.

        Args:
            races: their indices.
            rngs: a generator for each.
            moments: for those of the races that go on from a moment of a race instead; its clock goes on too.
        """
        for race, rng in zip(races, rngs, strict=True):
            if moments and race in moments:
                for array, row in zip(self.world.arrays(), moments[race].arrays, strict=True):
                    array[race] = row
                self.endings[race] = moments[race].endings
            else:
                self.world.reset(race, self.scenario.place(self._track, rng))
                self.endings[race] = ""
        for view in self._views:
            view.forget(races)
        self._look()

    def moment(self) -> Moment:
        """The present moment of all races."""
        return Moment(Races._make(array.copy() for array in self.world.arrays()), self.endings.copy())

    def _look(self) -> None:
        for view in self._views:
            view.look(self.world)

    def step(self, actions: NDArray[np.float32]) -> NDArray[np.float64]:
        """Advance by one agent step, 0.1 s unless the scenario has another action rate.

        Args:
            actions: (races, cars, 2); those of cars that no longer drive are ignored.

        Returns:
            (races, cars) reward: metres of centre line gained in the step, none while off course.

        Raises:
            ValueError: if an action is not finite.
        """
        faulty = np.argwhere(~np.isfinite(actions).all(axis=2))
        if len(faulty):
            race, car = faulty[0]
            raise ValueError(
                f"race {race}: the action of car {car} is {actions[race, car]}, expected finite numbers"
            )
        state, tick = self.world.state, self._reaction.tick
        before = state["progress"].copy()
        flags = {name: np.zeros(state.shape, np.bool_) for name in FLAGS}
        self.contacts, self.contact_races = self.contacts[:0], self.contact_races[:0]
        for _ in range(self._reaction.period[0] // tick):
            self.world.step(actions, tick)
            self._note_contacts()
            for name, flag in flags.items():
                flag |= state[name]
            self._look()
        for name, flag in flags.items():
            state[name] = flag
        end_runs(self.world, self.endings, self.limit_s, self._stuck_s)
        return np.where(state["off_course"], 0.0, state["progress"] - before)

    def _note_contacts(self) -> None:
        counts = self.world.contact_count
        races = np.flatnonzero(counts)
        if len(races):
            notes = [self.world.new_contacts(int(race)) for race in races]
            self.contacts = np.concatenate([self.contacts, *notes])
            self.contact_races = np.concatenate([self.contact_races, np.repeat(races, counts[races])])

    def facts(self) -> Facts:
        """What a log would note of each car, by name, (races, cars); a time that was not driven is nan.

        The place is that on the road: finishers by their time, then the others by progress.
        """
        state = self.world.state
        finish_s = np.where(self.endings == "finished", state["finish_s"], np.inf)
        order = np.lexsort((-state["progress"], finish_s), axis=-1)
        place = np.empty(state.shape, np.int64)
        np.put_along_axis(place, order, np.arange(1, state.shape[1] + 1)[None], axis=1)
        return {
            "place": place,
            "progress_m": state["progress"],
            "laps": state["laps"],
            "last_lap_s": state["last_lap_s"],
            "best_lap_s": state["best_lap_s"],
            "sectors_s": state["sector_s"],
            "gap_s": gaps(state),
            "finish_s": state["finish_s"],
            **{name: state[name] for name in FLAGS},
            "penalty_s": state["penalty_s"],
            "ending": self.endings,
        }


def info_of(facts: Facts, race: int, car: int) -> dict[str, Any]:
    """The facts of one car as plain values; a time that was not driven is None."""
    return {name: _plain(values[race, car].tolist()) for name, values in facts.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(part) for part in value]
    # Only nan differs from itself.
    return value if value == value else None

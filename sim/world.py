"""The batched world: many races at once, advanced by one compiled kernel per agent step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.blue_flags import NOBODY, show_blue_flags
from nathlon.sim.camera.picture import Photographer
from nathlon.sim.car import Car, CarParameters, compound_ratio, load_compounds, parameters, with_grip
from nathlon.sim.car_models import model_table
from nathlon.sim.clock import DYNAMICS_DT, DYNAMICS_HZ, SUBSTEPS
from nathlon.sim.conditions import Conditions, Start
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.observation_kernel import Nearby, blocks, observe_cars
from nathlon.sim.observation_parameters import ViewParameters, layout_parameters, view_parameters
from nathlon.sim.parameters import WorldParameters
from nathlon.sim.physics.chassis import GRAVITY, Rates
from nathlon.sim.physics.course import course_parameters
from nathlon.sim.physics.pit_lane import lane_parameters
from nathlon.sim.physics.tyre import Ground
from nathlon.sim.plan import UNPLANNED, Plan
from nathlon.sim.race_step import CONTACT_GAP_S, locate_all, step_races
from nathlon.sim.rules import Rules, blue_flag_parameters, load_rules, rule_parameters
from nathlon.sim.service import Service
from nathlon.sim.state import CAR_STATE, CONTACT, Races
from nathlon.sim.timing import first_line
from nathlon.sim.track import Track
from nathlon.sim.weather import film_after, wet_share
from nathlon.sim.work_stealing import Tally, ThreadPool

TYRE = "tyre_grip", "tyre_wear", "tyre_film", "tyre_peak"
ASKED = "asked_grip", "asked_wear", "asked_film", "asked_peak"
"""What is kept of the compound on a car, and of the one that is asked for."""


class World:
    """Races of the same circuit, car models and number of cars, advanced together.

    Attributes:
        state: (races, cars) CAR_STATE, the whole state; read it freely. Set `model` before a race is reset.
        ticks: (races,) int64, dynamics steps since each race's start.
        contacts: (races, pairs) CONTACT, the contacts that began in the last step, oldest first.
        contact_count: (races,) int64, how many of them there are.
        track, conditions, rules: as given.
        models: the cars that are driven; the state says which one each is.
        car: the first of them.
        plans: of a lap with each of them, by who has practised it; see `show`. None until they are shown.
        parameters: the kernels' view of cars, circuit, conditions and rules.
    """

    def __init__(
        self,
        track: Track,
        car: Car | Sequence[Car],
        races: int,
        cars: int,
        conditions: Conditions = Conditions(),
        rules: Rules | None = None,
        threads: int = 1,
    ) -> None:
        """Races without a start yet.

        Args:
            track: the circuit.
            car: the model that all drive, or several.
            races, cars: how many races, and cars in each.
            conditions: tyres, rates of wear and fuel, grip of the surfaces.
            rules: what the stewards go by; None for no penalties.
            threads: on which a step works; the results do not depend on them.

        Raises:
            InputError: if the conditions name an unknown compound.
        """
        self.track = track
        self.models = (car,) if isinstance(car, Car) else tuple(car)
        self.car = self.models[0]
        self.conditions, self.rules = conditions, rules
        self._of_models = [
            parameters(with_grip(model, conditions.grip.tarmac), conditions.compound) for model in self.models
        ]
        self.parameters = WorldParameters(
            model_table(self._of_models),
            course_parameters(track, conditions.grip),
            Rates(float(conditions.wear_rate), float(conditions.fuel_rate), bool(conditions.weather)),
            rule_parameters(rules or load_rules("free")),
            lane_parameters(track),
        )
        self.state = np.zeros((races, cars), CAR_STATE)
        self.ticks = np.zeros(races, np.int64)
        self.contacts = np.zeros((races, max(cars * (cars - 1) // 2, 1)), CONTACT)
        self.contact_count = np.zeros(races, np.int64)
        self._touched = np.full((races, cars, cars), -np.inf)
        self._races = Races(self.state, self.ticks, self._touched, self.contacts, self.contact_count)
        self._flags = None if rules is None else blue_flag_parameters(rules)
        self.plans: dict[str, tuple[Plan, ...]] = {}
        self._views = {"": self._see([UNPLANNED] * len(self.models))}
        self._ground = [Ground(*np.empty((3, 4))) for _ in range(threads)]
        self._threads = ThreadPool(threads)
        self._photographers: dict[ObservationSpec, Photographer] = {}

    def show(self, *plans: Plan, practised_by: str = "") -> None:
        """Have observations that see a plan see these.

        Args:
            plans: one for each model.
            practised_by: what the specs say of those who see them.
        """
        self.plans[practised_by] = plans
        self._views[practised_by] = self._see([plan.table for plan in plans])

    def _see(self, tables: Sequence[NDArray[np.float64]]) -> list[ViewParameters]:
        """What observations from each model need, which see these plans."""
        return [
            view_parameters(self.parameters._replace(car=model), table)
            for model, table in zip(self._of_models, tables, strict=True)
        ]

    def model(self, race: int, car: int) -> Car:
        """What a car is."""
        return self.models[self.state["model"][race, car]]

    def parameters_of(self, race: int, car: int) -> CarParameters:
        """The kernels' view of what a car is."""
        return self._of_models[self.state["model"][race, car]]

    @property
    def time(self) -> NDArray[np.float64]:
        """Time since each race's start, s, (races,)."""
        return self.ticks / DYNAMICS_HZ

    def arrays(self) -> Races:
        """All that changes in a step, not copied."""
        return self._races

    def reset(self, race: int, start: Start) -> None:
        """Put the cars of one race at their start, wheels rolling at the speed of the road.

        They keep what they are, and a reverse gear if they have one.
        """
        cars = self.state[race]
        kept = cars[["model", "has_reverse"]].copy()
        cars[:] = np.zeros((), CAR_STATE)
        cars[["model", "has_reverse"]] = kept
        x, y, heading = self.track.pose(start.distance, start.lateral)
        cars["x"], cars["y"], cars["yaw"] = x, y, heading + start.heading
        ahead, aside = np.cos(cars["yaw"]), np.sin(cars["yaw"])
        cars["world_velocity_x"] = start.speed * ahead - start.side_speed * aside
        cars["world_velocity_y"] = start.speed * aside + start.side_speed * ahead
        cars["yaw_rate"] = start.yaw_rate
        for model in range(len(self.models)):
            self._make_new(race, model, start)
        cars["wraps"] = np.floor(start.distance / self.track.length)
        along = start.distance - cars["wraps"] * self.track.length
        cars["row"] = np.minimum(along / self.track.spacing, len(self.track.table) - 1)
        cars["load"] = (cars["mass"] * GRAVITY / 4.0)[:, None]
        for unset in ("line_s", "sector_s", "last_lap_s", "best_lap_s", "finish_s"):
            cars[unset] = np.nan
        cars["contact_s"] = -np.inf
        cars["driving"], cars["pace"] = True, 1.0
        cars["flagged_for"] = NOBODY
        cars["sky"], cars["film"] = start.sky, self.conditions.film_mm
        cars["wet_grip"] = cars["wet_peak"] = 1.0
        if self.conditions.weather:
            self._wet_tyres(race)
        cars["finish"] = start.finish
        locate_all(cars, self.parameters.course)
        cars["start"] = cars["progress"]
        cars["laps"] = np.maximum(cars["wraps"], 0)
        cars["line"] = first_line(start.distance, self.track.sectors, self.track.length)
        self.ticks[race] = 0
        self.contact_count[race] = 0
        self._touched[race] = -np.inf

    def _make_new(self, race: int, model: int, start: Start) -> None:
        """Give the cars of a race that are of a model what such a car has at its start."""
        car, p = self.models[model], self._of_models[model]
        those = np.flatnonzero(self.state["model"][race] == model)
        state, speed = self.state[race, those], start.speed[those]
        state["spin"] = (speed / car.wheel.radius_m)[:, None]
        shift_up = car.engine.shift_up_rpm / 60.0 * 2.0 * np.pi
        fastest = shift_up / p.ratios * car.wheel.radius_m
        state["gear"] = np.minimum(np.searchsorted(fastest, speed), len(fastest) - 1)
        state["fuel"] = p.fuel_capacity
        state["mass"] = car.body.mass_kg
        for name, value in zip(TYRE, self._fitted(car, self.first_compound(car)), strict=True):
            state[name] = value
        self.state[race, those] = state

    def step(self, actions: NDArray[np.floating], substeps: int = SUBSTEPS) -> None:
        """Advance all races by one agent step.

        Args:
            actions: (races, cars, 2) in [-1, 1]: throttle (+) or brake (-), steering (+ is left).
                Must be finite; values outside the range are clipped. Cars that no longer drive
                ignore theirs.
            substeps: how many dynamics steps of 1/60 s it takes, at most one second.

        Raises:
            ValueError: if it is longer.
        """
        if substeps > CONTACT_GAP_S * DYNAMICS_HZ:
            # The notes of contacts have room for one of each two cars.
            raise ValueError(f"substeps is {substeps}, expected at most {CONTACT_GAP_S * DYNAMICS_HZ:.0f}")
        legal = np.clip(actions, -1.0, 1.0, dtype=np.float64)
        if self.conditions.weather:
            for race in range(len(self.state)):
                self._rain(race, substeps * DYNAMICS_DT)

        def work(tally: Tally, thread: int) -> None:
            step_races(self._races, legal, substeps, self._ground[thread], self.parameters, tally, thread)

        self._threads.run(work, len(self.state))
        if self._flags is not None:
            show_blue_flags(self.state, substeps * DYNAMICS_DT, self.track.length, self._flags)

    def rain_mm_h(self, race: int) -> float:
        """How hard it rains in a race now."""
        if not self.conditions.weather:
            return 0.0
        sky = self.state["sky"][race, 0]
        return self.conditions.weather[sky].rain_mm_h(float(self.time[race]), self.leader_lap(race))

    def leader_lap(self, race: int) -> int:
        """The lap that the first car of a race is in, 1 being the first."""
        return int(self.state["progress"][race].max() // self.track.length) + 1

    def _rain(self, race: int, time_s: float) -> None:
        """Have a race's weather go on for some time."""
        cars = self.state[race]
        driving = np.count_nonzero(cars["driving"]) / (self.track.length / 1000.0)
        cars["film"] = film_after(float(cars["film"][0]), self.rain_mm_h(race), driving, time_s)
        self._wet_tyres(race)

    def _wet_tyres(self, race: int) -> None:
        """Set what the water leaves of the tyres' grip in a race.

        A tyre's stiffness stays, so the slip at its peak falls with the grip.
        """
        cars = self.state[race]
        share = wet_share(float(cars["film"][0]), cars["tyre_film"])
        cars["wet_grip"], cars["wet_peak"] = share, share * cars["tyre_peak"]

    def fit(self, race: int, car: int, service: Service) -> None:
        """Do to a car at once what a stop would do: before its start."""
        state, p = self.state[race, car], self.parameters_of(race, car)
        if service.compound is not None:
            for name, value in zip(TYRE, self._fitted(self.model(race, car), service.compound), strict=True):
                state[name] = value
            state["wear"] = 0.0
        if service.fuel_kg is not None:
            state["fuel"] = min(service.fuel_kg, p.fuel_capacity)
            state["mass"] = p.dry_mass + state["fuel"]

    def ask_stop(self, race: int, car: int, service: Service | None) -> None:
        """Have a car stop the next time it comes to the pit lane's entry, or not stop after all.

        Args:
            race, car: indices.
            service: what is to be done; None for no stop.

        Raises:
            InputError: if there is no such compound.
        """
        state = self.state[race, car]
        state["asked"] = service is not None
        if service is None:
            return
        state["asked_tyres"] = service.compound is not None
        if service.compound is not None:
            for name, value in zip(ASKED, self._fitted(self.model(race, car), service.compound), strict=True):
                state[name] = value
        state["asked_fuel"] = 0.0 if service.fuel_kg is None else service.fuel_kg

    def ask_pace(self, race: int, car: int, pace: float) -> None:
        """Have a car drive at a share of its own speed from now on, if what drives it can be told."""
        self.state["pace"][race, car] = pace

    def first_compound(self, car: Car) -> str:
        """That which cars of a model start on."""
        return self.conditions.compound or car.tyre.compound

    def first_grip(self, car: Car) -> float:
        """Grip of the tyres that cars of a model start on, as a multiple of that of its own."""
        return compound_ratio(car.tyre.compound, self.first_compound(car))[0]

    def _fitted(self, car: Car, compound: str) -> tuple[float, float, float, float]:
        """Of a compound: grip and wear against those that the car starts on, then the film and the peak."""
        grip, wear = compound_ratio(self.first_compound(car), compound)
        fitted = load_compounds()[compound]
        return grip, wear, fitted.film_mm, fitted.peak_slip

    def new_contacts(self, race: int) -> NDArray[np.void]:
        """The contacts of one race that began in the last step, CONTACT."""
        return self.contacts[race, : self.contact_count[race]]

    def observe(
        self, spec: ObservationSpec, races: NDArray[np.int64], cars: NDArray[np.int64]
    ) -> NDArray[Any]:
        """Standardised observations of some cars.

        Args:
            spec: what to observe.
            races, cars: (n,) indices of the cars.

        Returns:
            (n, spec.size) float32, or with a camera (n,) records; see `ObservationSpec.blank`.

        Raises:
            InputError: if a plan is seen that has not been shown to this world.
            ValueError: if a camera is to see cars of several models.
        """
        if spec.camera is not None:
            if len(self.models) > 1:
                raise ValueError("a camera is to see cars of several models, expected one model")
            if spec not in self._photographers:
                self._photographers[spec] = Photographer(spec, self.track, self.car, self.state.shape[1])
            return self._photographers[spec].observe(self.state, self.ticks, races, cars, self._threads)
        if spec.planned and spec.practised_by not in self.plans:
            raise InputError(
                f"observation version {spec.version} sees a plan, expected a world that has been shown one"
            )
        views = self._views[spec.practised_by]
        if len(self.models) == 1:
            return self._observed(spec, races, cars, views[0])
        out = np.empty((len(races), spec.size), np.float32)
        for model, view in enumerate(views):
            rows = np.flatnonzero(self.state["model"][races, cars] == model)
            out[rows] = self._observed(spec, races[rows], cars[rows], view)
        return out

    def _observed(
        self, spec: ObservationSpec, races: NDArray[np.int64], cars: NDArray[np.int64], view: ViewParameters
    ) -> NDArray[np.float32]:
        """As `observe`, numbers from cars of one model."""
        out = np.empty((len(races), spec.size), np.float32)
        layout = layout_parameters(spec)

        def work(tally: Tally, thread: int) -> None:
            listed = spec.cars_ahead + spec.cars_behind
            nearby = Nearby(np.empty(listed, np.int64), np.empty(listed))
            observe_cars(self.state, races, cars, out, layout, nearby, view, tally, thread)

        self._threads.run(work, blocks(len(races)))
        return out

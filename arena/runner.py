"""Runs matches: one world for all their races, one matrix a policy and tick."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.classification import BLANK, classify
from nathlon.arena.halt import Halt
from nathlon.arena.match import Match, Swap
from nathlon.arena.pit_walls import Advised, PitWalls, strategist_of
from nathlon.arena.team import ROW_WISE, Absent, Team
from nathlon.arena.team_of_networks import TeamOfNetworks, join_networks
from nathlon.arena.watch import Watch
from nathlon.policies.driver.shown_plan import show_plans
from nathlon.policies.policy import Batch, Policy, has_reverse
from nathlon.policies.strategy import NO_STOPS, usual_strategist
from nathlon.sim.car import load_car
from nathlon.sim.episode import end_runs
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.reaction import Perception, Reaction
from nathlon.sim.scenario import load_scenario
from nathlon.sim.state import Races
from nathlon.sim.track import load_track
from nathlon.sim.world import World

log = logging.getLogger(__name__)

Observer = Callable[[World], None]
LineUp = tuple[Match, Sequence[Policy | Absent]]
"""A match and a policy for each of its entrants."""

LEG_SEEDS = 1_000_003
"""From the seeds of one leg to those of the next: more than entrants and seeds of a run take."""
EARLY_S = 1e-6
"""By how much a moment of the world may fall short of one that is named."""
MOTION = ("x", "y", "yaw", "world_velocity_x", "world_velocity_y", "yaw_rate")
"""Fields of CAR_STATE that no other can be wrong for long without."""


def run_match(
    match: Match, policies: Sequence[Policy | Absent], observer: Observer | None = None
) -> pl.DataFrame:
    """Run all races of a match to their end.

    Args:
        match: what to run.
        policies: one for each of the match's entrants.
        observer: called with the world before the first tick and after every tick.

    Returns:
        the results, one row a car a race, schema RESULTS.
    """
    [(_, results)] = run_together({0: (match, policies)}, Watch(), observer)
    return results


def run_together(
    line_ups: Mapping[int, LineUp], watch: Watch, observer: Observer | None = None
) -> Iterator[tuple[int, pl.DataFrame]]:
    """Run matches of the same scenario, circuit and cars in one world.

    Every match has the results that it has alone.

    Args:
        line_ups: what to run, by numbers of the caller's.
        watch: told who is asked, with the number of the match.
        observer: as for `run_match`.

    Yields:
        the number of a match and its results (RESULTS), as soon as its last race has ended.
    """
    meeting = _Meeting(line_ups, watch)
    running = list(line_ups)
    if observer:
        observer(meeting.world)
    while running:
        for number in [number for number in running if meeting.over(number)]:
            running.remove(number)
            yield number, meeting.results(number)
        meeting.drop_cars_that_are_out()
        ended = not running
        while not ended:
            ended = meeting.tick()
            if observer:
                observer(meeting.world)


def run_until(
    match: Match,
    policies: Sequence[Policy | Absent],
    watch: Watch,
    until_s: float,
    leg: int = 0,
    begin: Halt | None = None,
    observer: Observer | None = None,
) -> tuple[Halt, pl.DataFrame | None]:
    """Run a match up to a moment, or on from one.

    Args:
        match, policies, observer: as for `run_match`.
        watch: told who is asked.
        until_s: when to halt, s since the start; whole seconds, at which all cars act.
        leg: how often it has halted before; policies that are code draw other numbers in each leg.
        begin: where it goes on; None for the start.

    Returns:
        where it halts, and the results (RESULTS) if all races are over.
    """
    meeting = _Meeting({0: (match, policies)}, watch, leg, begin)
    if observer:
        observer(meeting.world)
    ended = True
    while not meeting.over(0) and (meeting.world.time < until_s - EARLY_S).any():
        if ended:
            meeting.drop_cars_that_are_out()
        ended = meeting.tick()
        if observer:
            observer(meeting.world)
    return meeting.halt(), meeting.results(0) if meeting.over(0) else None


def check_sight(match: Match, policies: Sequence[Policy | Absent]) -> None:
    """Raise an InputError for a policy with a camera among several classes: all cars look alike to it."""
    for source, policy in zip(match.sources, policies, strict=True):
        if match.classes and not isinstance(policy, Absent) and policy.observation_spec.camera:
            raise InputError(
                f"{source}: sees by a camera, expected one that is told numbers in a race of several classes"
            )


class _View:
    """Teams that observe by the same spec, and what their cars see."""

    def __init__(self, spec: ObservationSpec, teams: list[Team], grid: int, reaction: Reaction) -> None:
        """Teams of a world with `grid` cars a race."""
        self.teams = join_networks(teams)
        cars = np.concatenate([team.cars for team in self.teams])
        self._perception = Perception(spec, cars // grid, cars % grid, reaction)

    def keep(self, driving: NDArray[np.bool_]) -> None:
        """Look no more for cars whose policy need not be asked; see `Team.keep`."""
        self._perception.keep(np.concatenate([team.keep(driving) for team in self.teams]))
        self.teams = [team for team in self.teams if len(team.cars)]

    def look(self, world: World) -> Iterator[tuple[Team | TeamOfNetworks, Batch, NDArray[np.bool_]]]:
        """The teams that have cars to act, what all their cars see, and which are due; once a tick."""
        seen, due = self._perception.see(world), self._perception.due(world)
        begin = 0
        for team in self.teams:
            rows = slice(begin, begin := begin + len(team.cars))
            if due[rows].any():
                yield team, seen[rows], due[rows]


class _Relief(NamedTuple):
    """Somebody who takes a car over from a moment on, and its pit wall.

    It is asked for all cars of the one whose place it takes, and heard for its own: matrix products round
    differently with the number of rows, and so the same policy drives the same to the bit.

    Attributes:
        car: index in the world.
        from_s: when, s.
        view: what it would see in all those cars; None if its policy is absent.
        policy: its policy.
        advised: the car with its strategist; None if it is the entrant who drove before.
    """

    car: int
    from_s: float
    view: _View | None
    policy: Policy | Absent
    advised: Advised | None


class _Meeting:
    """Matches that share a world, whose cars are numbered race by race."""

    def __init__(
        self, line_ups: Mapping[int, LineUp], watch: Watch, leg: int = 0, begin: Halt | None = None
    ) -> None:
        """Matches at their start, or as they halted after so many legs."""
        self._leg = leg
        self._matches = {number: match for number, (match, _) in line_ups.items()}
        races = [race for match in self._matches.values() for race in match.races]
        ends = np.cumsum([0, *(len(match.races) for match in self._matches.values())])
        self._races = {number: slice(*span) for number, span in zip(line_ups, pairwise(ends), strict=True)}
        first = next(iter(self._matches.values()))
        scenario, track = load_scenario(first.scenario), load_track(first.circuit)
        self._time_s, self._reaction, self._watch = scenario.time_s, scenario.reaction, watch
        watch.work()
        self.world = scenario.world(track, [load_car(car) for car in first.cars], len(races))
        self.world.state["model"] = [
            [match.cars.index(match.car_of(seat.entrant)) for seat in race.seats]
            for match in self._matches.values()
            for race in match.races
        ]
        for index, race in enumerate(races):
            self.world.reset(index, scenario.place(track, np.random.default_rng(race.seed)))
        self._cars = self.world.state.reshape(-1)
        self._endings = np.full(self.world.state.shape, "", dtype="U16")
        self._driven = np.zeros(self.world.state.shape)
        self._actions = np.zeros((self._cars.size, 2), np.float32)
        if begin is not None:
            for array, kept in zip(self.world.arrays(), begin.races, strict=True):
                array[:] = kept
            self._endings[:], self._driven[:] = begin.endings, begin.driven
        for match, policies in line_ups.values():
            check_sight(match, policies)
        everybody = [one for _, policies in line_ups.values() for one in policies]
        show_plans(self.world, *(one for one in everybody if not isinstance(one, Absent)))
        self._views = self._line_up(line_ups)
        if begin is not None:
            for team in self._teams:
                team.recall(begin.memory)
        self._usual = [usual_strategist(scenario, model) for model in self.world.models]
        self._reliefs = [
            self._relief(number, match.swap, policies)
            for number, (match, policies) in line_ups.items()
            if match.swap
        ]
        taken = [one.advised for one in self._reliefs if one.advised and one.from_s < EARLY_S]
        advised, notes = (*self._advised(line_ups), *taken), begin.pit_walls if begin else ""
        self._pit_walls = PitWalls(self.world, scenario.laps, advised, watch, notes)

    def _line_up(self, line_ups: Mapping[int, LineUp]) -> list[_View]:
        """All teams by what they observe; cars whose policy is absent are out."""
        grid = self._endings.shape[1]
        shared: dict[int, list[Team]] = defaultdict(list)
        views: dict[ObservationSpec, list[Team]] = defaultdict(list)
        for number, (match, policies) in line_ups.items():
            seats = np.array([[seat.entrant for seat in race.seats] for race in match.races])
            for entrant, policy in enumerate(policies):
                cars = np.flatnonzero(seats == entrant) + grid * self._races[number].start
                self._cars["has_reverse"][cars] = has_reverse(policy)
                if isinstance(policy, Absent):
                    self._retire(cars, policy.ending)
                elif isinstance(policy, ROW_WISE):
                    shared[id(policy)].append(Team(policy, cars, number, entrant))
                else:
                    seed = match.races[0].seed + entrant + LEG_SEEDS * self._leg
                    team = Team(policy, cars, number, entrant, seed)
                    views[policy.observation_spec].append(team)
        for teams in shared.values():
            everybody = Team(teams[0].policy, np.concatenate([team.cars for team in teams]), 0, 0)
            views[everybody.policy.observation_spec].append(everybody)
        return [_View(spec, teams, grid, self._reaction) for spec, teams in views.items()]

    @property
    def _teams(self) -> Iterator[Team]:
        """Those that remember something."""
        for view in self._views:
            yield from (team for team in view.teams if isinstance(team, Team))

    def halt(self) -> Halt:
        """The present state, copied."""
        memory = {car: row.copy() for team in self._teams for car, row in team.memory.items()}
        races = Races._make(array.copy() for array in self.world.arrays())
        return Halt(races, self._endings.copy(), self._driven.copy(), self._pit_walls.notes, memory)

    def _advised(self, line_ups: Mapping[int, LineUp]) -> Iterator[Advised]:
        """The cars whose policies have a strategist, or that stop as their scenario says."""
        for number, (match, policies) in line_ups.items():
            for index, race in enumerate(match.races, start=self._races[number].start):
                for car, seat in enumerate(race.seats):
                    usual = self._usual[self.world.state["model"][index, car]]
                    if strategist := strategist_of(policies[seat.entrant], usual):
                        yield Advised(index, car, number, seat.entrant, strategist)

    def _relief(self, number: int, swap: Swap, policies: Sequence[Policy | Absent]) -> _Relief:
        match, first, grid = self._matches[number], self._races[number].start, self._endings.shape[1]
        before = match.races[swap.race].seats[swap.car].entrant
        seats = np.array([[seat.entrant for seat in race.seats] for race in match.races])
        cars = np.flatnonzero(seats == before) + grid * first
        view, advised, policy, race = None, None, policies[swap.entrant], int(first) + swap.race
        if match.entrants[swap.entrant] != match.entrants[before]:
            usual = self._usual[self.world.state["model"][race, swap.car]]
            advised = Advised(race, swap.car, number, swap.entrant, strategist_of(policy, usual) or NO_STOPS)
        if not isinstance(policy, Absent):
            team = Team(policy, cars, number, swap.entrant, match.races[0].seed + before)
            view = _View(policy.observation_spec, [team], grid, self._reaction)
        return _Relief(grid * race + swap.car, swap.from_s, view, policy, advised)

    def _retire(self, cars: NDArray[np.int64], ending: str) -> None:
        """Take those of some cars that still drive out of their races, now."""
        cars = cars[self._cars["driving"][cars]]
        self._endings.flat[cars] = ending
        self._driven.flat[cars] = self.world.time[cars // self._endings.shape[1]]
        self._cars["driving"][cars] = False

    def drop_cars_that_are_out(self) -> None:
        """Ask no more for cars that are out, as far as it does not change what the others do."""
        for view in self._views:
            view.keep(self._cars["driving"])
        self._views = [view for view in self._views if view.teams]
        driving = self._cars["driving"]
        self._reliefs = [relief for relief in self._reliefs if driving[relief.car]]
        for relief in self._reliefs:
            if relief.view:
                relief.view.keep(driving)

    def over(self, number: int) -> bool:
        """Whether no car of a match drives any more."""
        return not self.world.state["driving"][self._races[number]].any()

    def results(self, number: int) -> pl.DataFrame:
        """RESULTS of a match that is over."""
        races, match = self._races[number], self._matches[number]
        stints = self._pit_walls.stints(races)
        return classify(match, self.world.state[races], self._endings[races], self._driven[races], stints)

    def tick(self) -> bool:
        """Have everybody act whose turn it is, and advance the world; whether a car's run has ended."""
        state = self.world.state
        before = np.count_nonzero(state["driving"])
        self._act()
        driving = state["driving"].copy()
        self._watch.work()
        self.world.step(self._actions.reshape(*state.shape, 2), self._reaction.tick)
        self._void_faulty_races(driving)
        if failed := self._pit_walls.listen():
            self._retire(np.ravel_multi_index(tuple(zip(*failed, strict=True)), state.shape), "policy_raised")
        end_runs(self.world, self._endings, self._time_s)
        if np.count_nonzero(state["driving"]) == before:
            return False
        ended = driving & ~state["driving"] & (self._endings != "simulator_fault")
        now = np.where(self._endings == "finished", state["finish_s"], self.world.time[:, None])
        self._driven[ended] = now[ended]
        return True

    def _act(self) -> None:
        """Set the actions of all cars whose turn it is; those with a faulty policy are out."""
        relieved = self._relieved()
        for view in self._views:
            for team, seen, due in view.look(self.world):
                actions, fault = team.act(self.world, seen, due, self._watch)
                asked = team.cars[due]
                self._actions[asked] = actions[due]
                if fault:
                    self._retire(np.setdiff1d(asked, relieved), fault)
        for relief in self._reliefs:
            self._take_over(relief, relief.car in relieved)
        illegal = ~np.isfinite(self._actions).all(axis=1)
        if illegal.any():
            if self._cars["driving"][illegal].any():
                log.warning("a policy gave actions that are not finite: its cars are out")
            self._retire(np.flatnonzero(illegal), "illegal_action")
            self._actions[illegal] = 0.0

    def _relieved(self) -> list[int]:
        """Cars that somebody else drives by now."""
        grid = self._endings.shape[1]
        return [
            relief.car
            for relief in self._reliefs
            if self.world.time[relief.car // grid] > relief.from_s - EARLY_S
        ]

    def _take_over(self, relief: _Relief, now: bool) -> None:
        """Look at the race as a relief does, and set the action of its car if it drives now."""
        if isinstance(relief.policy, Absent):
            if now:
                self._retire(np.array([relief.car]), relief.policy.ending)
            return
        assert relief.view is not None, "a policy looks"
        if now:
            self._cars["has_reverse"][relief.car] = has_reverse(relief.policy)
            if relief.advised:
                self._pit_walls.hand_over(relief.advised)
        # What it sees may be late: it looks from the start.
        for team, seen, due in relief.view.look(self.world):
            [row] = np.flatnonzero(team.cars == relief.car)
            if not (now and due[row]):
                continue
            actions, fault = team.act(self.world, seen, due, self._watch)
            self._actions[relief.car] = actions[row]
            if fault:
                self._retire(team.cars[[row]], fault)

    def _void_faulty_races(self, driving: NDArray[np.bool_]) -> None:
        """Void the races in which the motion of a car that drove in the last step is not finite."""
        state = self.world.state
        finite = np.isfinite(sum(state[name] for name in MOTION))
        if finite.all():
            return
        faulty = (driving & ~finite).any(axis=1)
        if faulty.any():
            state[faulty] = BLANK
            self._endings[faulty] = "simulator_fault"
            self._driven[faulty] = 0.0

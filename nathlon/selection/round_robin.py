"""The third stage: the shortlist meets in mirrored races, until it is clear who is better."""

from __future__ import annotations

import time
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Annotated

import numpy as np
import polars as pl
from pydantic import Field

from nathlon.arena.entrance import enter_each
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import BACKGROUND, NO_TEAM, Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.results import RANKING, RECORDS, RESULTS
from nathlon.arena.voids import not_judged_by_meetings
from nathlon.arena.world import Setup
from nathlon.arena.world_finding import RACING
from nathlon.arena.world_registry import home, load_world
from nathlon.policies.sources.identity import policy_id
from nathlon.selection.bounds import MOST_PAIRS
from nathlon.selection.crossing import cells
from nathlon.selection.run import CONFIDENCE, Answer, Run
from nathlon.sim.data_file import Section
from nathlon.sim.errors import InputError
from nathlon.tournament.conduct import Gate
from nathlon.tournament.event import Event, EventRace, ScenarioRace, load_event
from nathlon.tournament.formats import FORMATS, FormatName
from nathlon.tournament.points import matchups, rank
from nathlon.tournament.ratings import notes, rate
from nathlon.tournament.records import records
from nathlon.tournament.schedule import Meeting, meetings
from nathlon.tournament.stopping import Stopping, repeated, settled, settled_in_gauntlet
from nathlon.tournament.two_way import two_way


class TournamentSettings(Section):
    """How the tournament is run.

    Attributes:
        format: of all matches, where there is no event.
        pairs: units of evidence (mirrored pairs, blocks of a free-for-all) of every matchup, at most.
        block: units of a round; after each round it is decided who must race on.
        sequential: stop early where it is clear who is better; otherwise all `pairs` are raced at once.
        effect: the least mean difference of a unit that matters, in standard deviations of units.
        drop: standard errors behind the leader beyond which an entrant races no more.
        max_contacts_per_km, max_at_fault_per_km: rates a car that bar an entrant whose interval lies above.
        event: path of the file of an event of several races.
    """

    format: FormatName = "4v4"
    pairs: Annotated[int, Field(ge=2, le=MOST_PAIRS)] = 12
    block: Annotated[int, Field(ge=2, le=MOST_PAIRS)] = 4
    sequential: bool = True
    effect: Annotated[float, Field(ge=0.001, le=100)] = 0.5
    drop: Annotated[float, Field(ge=0.001, le=100)] = 3.3
    max_contacts_per_km: Annotated[float, Field(gt=0)] | None = None
    max_at_fault_per_km: Annotated[float, Field(gt=0)] | None = None
    event: str | None = None

    def held(self, circuit: str, car: str, world: str = RACING) -> Event:
        """The event, or one race where there is none; in another world all scenarios in which some meet.

        Raises:
            InputError: if the event's file is wrong.
        """
        if self.event is not None:
            return load_event(Path(self.event))
        if not circuit:
            there = load_world(world)
            sides = {scenario: len(there.setup(scenario).sides) for scenario in there.scenarios}
            return Event.model_construct(
                race=tuple(
                    ScenarioRace(name=scenario, circuit="", car="", sides=count, format=self.format)
                    for scenario, count in sides.items()
                    if count > 1
                )
            )
        return Event(race=(EventRace(name=self.format, circuit=circuit, car=car, format=self.format),))


@dataclass(frozen=True)
class RoundRobinAnswer(Answer):
    """What the round robin found out.

    Attributes:
        records: RECORDS; empty where all races are 4v4.
    """

    records: pl.DataFrame


@dataclass(frozen=True)
class Fixture:
    """A meeting of an event's race, with its entrants as they drive there."""

    race: EventRace
    meeting: Meeting
    entrants: tuple[Entrant, ...]

    def match(self, units: slice, stage: str = "tournament") -> Match:
        """The match of some of its units, for a stage."""
        numbered = list(enumerate(self.meeting.seeds))[units]
        race, races = self.race, [each for number, seed in numbered for each in self._unit(number, seed)]
        ids, sources = zip(*((entrant.id, entrant.source) for entrant in self.entrants), strict=True)
        if self._setup.free:
            world = home(self.entrants[0])
            ids, sources = (*ids, policy_id(world.baseline)), (*sources, world.baseline)
        return Match(
            stage,
            race.name,
            race.raced,
            race.circuit,
            race.car,
            ids,
            sources,
            tuple(races),
            self.entrants[0].world,
        )

    @property
    def _setup(self) -> Setup:
        return home(self.entrants[0]).setup(self.race.raced)

    def _unit(self, number: int, seed: int) -> list[Race]:
        """The races of a unit; in a free-for-all the entrants are on its grids in an order of its own.

        With more entrants than places it is the order of all units: who meets whom follows from the design.
        """
        made, order = self.race.made, np.arange(len(self.entrants))
        if not made.teams:
            design = len(order) > len(self._setup.sides)
            order = np.random.default_rng(self.meeting.seeds[0] if design else seed).permutation(order)
        return [
            Race(seed, self._seats([int(order[side]) for side in grid.sides], grid.sides), grid.mirrored)
            for grid in made.grids(len(order), number)
        ]

    def _seats(self, entrants: Sequence[int], teams: Sequence[int]) -> tuple[Seat, ...]:
        """Who sits where if these entrants take the sides in their order."""
        seats = dict.fromkeys(self._setup.free, Seat(len(self.entrants), BACKGROUND))
        for side, entrant, team in zip(self._setup.sides, entrants, teams, strict=True):
            seats |= dict.fromkeys(side, Seat(entrant, team if self.race.made.teams else NO_TEAM))
        return tuple(seats[seat] for seat in range(len(seats)))

    @property
    def pairs(self) -> set[frozenset[str]]:
        """Every two that meet."""
        return {frozenset(two) for two in combinations(self.meeting.entrants, 2)}


def run_round_robin(
    run: Run, entrants: Sequence[Entrant], settings: TournamentSettings, references: Container[str] = ()
) -> tuple[RoundRobinAnswer, list[Match]]:
    """Race all entrants against each other; those that share the first rank, the barred apart, go on.

    In a gauntlet all others race those whose ids are `references`.

    Matches come in rounds. What is raced in a round depends on the results of the rounds before and on
    nothing else, so that a run that was stopped goes on as it would have.

    Raises:
        InputError: if the event's file is wrong, an entrant cannot drive one of its races, or a gauntlet has
            no references.
    """
    began = time.perf_counter()
    event = event_of(entrants, settings)
    fields = [entered_there(run.pool, entrants, race.circuit, race.car) for race in event.race]
    if any(race.made.gauntlet for race in event.race) and not any(e.id in references for e in entrants):
        raise InputError("field nightly.anchors is empty: expected the references of the gauntlet")
    fixtures = plan(event, fields, settings.pairs, run.seeds("tournament"), references)
    matches, results = _race(run, fixtures, event, settings, references)
    confidence = repeated(CONFIDENCE, len(_rounds(fixtures, settings)))
    tables = _tables(run, entrants, results, event.weights, settings, confidence)
    if any(race.format == "event" for race in event.race):
        tables["strategies"] = two_way(results, cells(entrants, references), confidence)
    first = leaders(entrants, tables["ranking"])
    run.note("tournament", len(entrants), len(first), results, began)
    of_teams = all(race.made is FORMATS["4v4"] for race in event.race)
    told = pl.DataFrame(schema=RECORDS)
    if not of_teams:
        told = records(results, run.rng("tournament"), confidence=confidence, weights=event.weights)
    return RoundRobinAnswer(tables, first, results, not_judged_by_meetings(results), told), matches


def leaders(entrants: Sequence[Entrant], ranking: pl.DataFrame) -> list[Entrant]:
    """Those of the entrants that share the first rank of RANKING among the ones that are not barred."""
    allowed = ranking.filter(~pl.col("barred"))
    first = set(allowed.filter(pl.col("rank") == pl.col("rank").min())["entrant"])
    return [entrant for entrant in entrants if entrant.id in first]


def ranked_by_tests(battery: pl.DataFrame, entrants: Sequence[Entrant]) -> pl.DataFrame:
    """RANKING of some entrants by the points of BATTERY, where they cannot meet."""
    chosen = battery.filter(pl.col("entrant").is_in([entrant.id for entrant in entrants])).select(
        "entrant", "rank", "worst_rank", "points_low", "points_high", points_per_race="points"
    )
    missing = {name: dtype for name, dtype in RANKING.items() if name not in chosen.columns}
    counts = {"pairs": 0, "races": 0, "faults": 0, "barred": False}
    return (
        chosen.with_columns(
            pl.lit(counts.get(name)).cast(dtype).alias(name) for name, dtype in missing.items()
        )
        .select(RANKING.names())
        .cast(RANKING)
    )


def tournament_matches(entrants: Sequence[Entrant], pairs: int, seeds: np.random.SeedSequence) -> list[Match]:
    """A 4v4 round robin of mirrored pairs, one match a matchup."""
    event = event_of(entrants, TournamentSettings())
    fixtures = plan(event, [list(entrants)] * len(event.race), pairs, seeds)
    return [fixture.match(slice(None)) for fixture in fixtures]


def event_of(entrants: Sequence[Entrant], settings: TournamentSettings) -> Event:
    """The event where the entrants are at home; one without races if there are none."""
    if not entrants:
        return Event.model_construct(race=())
    return settings.held(entrants[0].circuit, entrants[0].car, entrants[0].world)


def entered_there(pool: Pool, entrants: Sequence[Entrant], circuit: str, car: str) -> list[Entrant]:
    """Entrants on a circuit that may not be their own, where a composite is another policy."""
    sources = [e.source for e in entrants if (e.circuit, e.car) != (circuit, car)]
    there: dict[str, Entrant] = {}
    for source, answer in zip(sources, enter_each(pool, sources, circuit, car), strict=True):
        if isinstance(answer, InputError):
            raise answer
        there[source] = answer
    return [there.get(entrant.source, entrant) for entrant in entrants]


def plan(
    event: Event,
    fields: Sequence[Sequence[Entrant]],
    pairs: int,
    seeds: np.random.SeedSequence,
    references: Container[str] = (),
) -> list[Fixture]:
    """All meetings of an event, race by race.

    Args:
        event: what is raced.
        fields: of each race who takes part, entered for its circuit and car.
        pairs: units of evidence of every matchup, at most, of races that do not say how many.
        seeds: of all units.
        references: ids of those whom the others race in a gauntlet.
    """
    fixtures: list[Fixture] = []
    for race, field, stream in zip(event.race, fields, seeds.spawn(len(event.race)), strict=True):
        here = {entrant.id: entrant for entrant in field}
        fixtures += [
            Fixture(race, meeting, tuple(here[entrant] for entrant in meeting.entrants))
            for meeting in meetings(list(here), race.made, race.pairs or pairs, stream, references)
        ]
    return fixtures


def _race(
    run: Run,
    fixtures: Sequence[Fixture],
    event: Event,
    settings: TournamentSettings,
    references: Container[str],
) -> tuple[list[Match], pl.DataFrame]:
    """Round after round until everything is settled or all units are raced."""
    matches: list[Match] = []
    results = pl.DataFrame(schema=RESULTS)
    over: dict[bool, set[frozenset[str]]] = {True: set(), False: set()}
    stopping = Stopping(settings.effect, settings.drop)
    for units in _rounds(fixtures, settings):
        played = [
            fixture.match(units)
            for fixture in fixtures
            if fixture.meeting.seeds[units] and not fixture.pairs <= over[fixture.race.made.gauntlet]
        ]
        if not played:
            break
        matches += played
        results = run.results("tournament", matches).filter(pl.col("team") != BACKGROUND)
        over[False] = settled(results, stopping, event.weights)
        over[True] = settled_in_gauntlet(results, stopping, event.weights, references)
    return matches, results


def _rounds(fixtures: Sequence[Fixture], settings: TournamentSettings) -> list[slice]:
    """The units of each round."""
    longest = max((len(fixture.meeting.seeds) for fixture in fixtures), default=1)
    block = settings.block if settings.sequential else longest
    return [slice(begin, begin + block) for begin in range(0, longest, block)]


def _tables(
    run: Run,
    entrants: Sequence[Entrant],
    results: pl.DataFrame,
    weights: Mapping[str, float],
    settings: TournamentSettings,
    confidence: float,
) -> dict[str, pl.DataFrame]:
    gate = Gate(settings.max_contacts_per_km, settings.max_at_fault_per_km)
    names = {entrant.id: entrant.name for entrant in entrants}
    rng = run.rng
    return {
        "ranking": rank(results, rng("tournament"), confidence=confidence, weights=weights, gate=gate),
        "matchups": matchups(results, rng("tournament"), confidence=confidence, weights=weights),
        "ratings": rate(results, weights),
        "tournament_notes": notes(results, names, confidence, weights),
    }

"""The tournament stage: rounds of matches, from the store where they are there, until all is settled."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal
from pydantic import ValidationError

from nathlon.arena.entrant import Entrant, enter
from nathlon.arena.pool import Pool
from nathlon.arena.results import MATCHUPS, RANKING, RATINGS, RESULTS, TOURNAMENT_NOTES
from nathlon.arena.store import Store
from nathlon.selection.round_robin import (
    TournamentSettings,
    leaders,
    plan,
    run_round_robin,
    tournament_matches,
)
from nathlon.selection.run import Run
from nathlon.sim.errors import InputError
from nathlon.tournament.event import Event, EventRace
from nathlon.tournament.stopping import Stopping, settled

SPRINT = """
[[race]]
name = "sprint"
circuit = "lindenring"
car = "gt3"
format = "2v2"
scenario = "chicane_in_traffic"

[[race]]
name = "seaside"
circuit = "porto-sereno"
car = "coupe"
format = "1v1"
scenario = "slipstream_pass"
weight = 2.0
pairs = 4
"""

GAUNTLET = """
[[race]]
name = "newcomers"
circuit = "lindenring"
car = "gt3"
format = "gauntlet"
scenario = "sprint"
"""

DRIVERS = [enter(f"driver:pace={pace}", "lindenring", "gt3") for pace in (0.95, 0.94, 0.5)]


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(1) as made:
        yield made


def stage(folder: Path, pool: Pool, seen: list[int] | None = None) -> Run:
    store = Store(folder / "store.sqlite")
    store.begin_run("test", {})
    started = [] if seen is None else seen
    return Run(store, "test", (7,), pool, lambda stage, done, total: started.append(total - done))


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> TournamentSettings:
    path = tmp_path_factory.mktemp("event") / "event.toml"
    path.write_text(SPRINT, "utf-8")
    return TournamentSettings(pairs=8, block=4, event=str(path))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


def test_each_round_races_what_the_rounds_before_left_open(
    folder: Path, pool: Pool, settings: TournamentSettings
) -> None:
    answer, matches = run_round_robin(stage(folder, pool), DRIVERS, settings)
    first, later = matches[:6], matches[6:]
    assert [match.test for match in first] == ["sprint"] * 3 + ["seaside"] * 3
    assert [(len(match.races), len(match.races[0].seats)) for match in first] == [(8, 4)] * 3 + [(8, 2)] * 3
    results = answer.results.filter(pl.col("match").is_in([match.key for match in first]))
    over = settled(results, Stopping(settings.effect, settings.drop), {"seaside": 2.0})
    assert 0 < len(over) < 3
    assert {frozenset(match.entrants) for match in later} == {
        frozenset(match.entrants) for match in first if frozenset(match.entrants) not in over
    }
    assert {match.test for match in later} == {"sprint"}, "the other race has had its units"
    seeds = [race.seed for match in matches for race in match.races]
    assert len(set(seeds)) == len(seeds) / 2

    schemas = {name: table.schema for name, table in answer.tables.items()}
    assert schemas == {
        "ranking": RANKING,
        "matchups": MATCHUPS,
        "ratings": RATINGS,
        "tournament_notes": TOURNAMENT_NOTES,
    }
    assert answer.tables["ranking"]["entrant"][2] == DRIVERS[2].id
    assert answer.tables["ranking"]["races"].sum() == 2 * len(seeds)
    assert DRIVERS[2] not in answer.entrants


def test_a_tournament_that_goes_on_from_its_store_runs_nothing_and_says_the_same(
    folder: Path, pool: Pool, settings: TournamentSettings
) -> None:
    before, _ = run_round_robin(stage(folder, pool), DRIVERS, settings)
    missing: list[int] = []
    after, matches = run_round_robin(stage(folder, pool, missing), DRIVERS, settings)
    assert set(missing) == {0}
    for name, table in before.tables.items():
        assert_frame_equal(table, after.tables[name])
    longer = settings.model_copy(update={"pairs": 10})
    _, more = run_round_robin(stage(folder, pool), DRIVERS, longer)
    assert [match.key for match in more[: len(matches)]] == [match.key for match in matches]


def test_more_finalists_than_places_meet_each_other_about_equally_often() -> None:
    """Over the rounds in which their races are given out, and in every unit from each place once."""
    field = [replace(DRIVERS[0], id=str(number)) for number in range(12)]
    event = Event(race=(EventRace(name="all", circuit="lindenring", car="gt3", format="ffa8"),))
    [fixture] = plan(event, [field], 4, np.random.SeedSequence(3))
    races = [*fixture.match(slice(0, 2)).races, *fixture.match(slice(2, 4)).races]
    met = Counter(two for race in races for two in combinations(sorted(s.entrant for s in race.seats), 2))
    assert set(met) == set(combinations(range(12), 2))
    assert max(met.values()) - min(met.values()) <= 1
    for unit in range(4):
        for place in range(8):
            taken = [race.seats[place].entrant for race in races[12 * unit : 12 * unit + 12]]
            assert sorted(taken) == list(range(12))


def test_without_stopping_every_matchup_is_one_match_with_all_its_pairs() -> None:
    matches = tournament_matches(DRIVERS, 3, np.random.SeedSequence(0))
    assert len(matches) == 3
    for match in matches:
        assert (match.test, match.scenario, match.stage) == ("4v4", "race", "tournament")
        for race, mirror in zip(match.races[::2], match.races[1::2], strict=True):
            assert race.seed == mirror.seed
            assert (race.mirrored, mirror.mirrored) == (False, True)
            assert [(seat.entrant, seat.team) for seat in race.seats] == [(0, 0), (1, 1)] * 4
            assert [(seat.entrant, seat.team) for seat in mirror.seats] == [(1, 1), (0, 0)] * 4


def test_a_free_for_all_is_one_match_without_teams() -> None:
    names = [f"driver:pace={0.8 + k / 100}" for k in range(8)]
    entrants = [enter(name, "lindenring", "gt3") for name in names]
    event = Event(race=(EventRace(name="all", circuit="lindenring", car="gt3", format="ffa8"),))
    [fixture] = plan(event, [entrants], 3, np.random.SeedSequence(0))
    match = fixture.match(slice(0, 2))
    assert len(match.races) == 16
    assert [race.seed for race in match.races] == [fixture.meeting.seeds[k] for k in (0, 1) for _ in range(8)]
    assert {seat.team for race in match.races for seat in race.seats} == {-1}
    assert len({seat.entrant for seat in match.races[0].seats}) == 8


@pytest.mark.parametrize("entrants", [3, 12])
def test_a_free_for_all_takes_any_number_of_entrants(entrants: int) -> None:
    drivers = [enter(f"driver:pace={0.8 + k / 100}", "lindenring", "gt3") for k in range(entrants)]
    event = Event(race=(EventRace(name="all", circuit="lindenring", car="gt3", format="ffa8"),))
    [fixture] = plan(event, [drivers], 2, np.random.SeedSequence(0))
    match = fixture.match(slice(None))
    assert {len(race.seats) for race in match.races} == {8}
    for unit in (match.races[:entrants], match.races[entrants:]):
        assert len({race.seed for race in unit}) == 1
        starts = [(seat.entrant, place) for race in unit for place, seat in enumerate(race.seats)]
        assert len(set(starts)) == len(starts) == 8 * entrants
    order, other = ([seat.entrant for seat in match.races[k].seats] for k in (0, entrants))
    assert order != other, "units differ in who starts next to whom"


def test_in_a_gauntlet_all_race_the_references_and_are_ranked_together(tmp_path: Path, pool: Pool) -> None:
    path = tmp_path / "event.toml"
    path.write_text(GAUNTLET, "utf-8")
    settings = TournamentSettings(pairs=4, block=4, event=str(path))
    answer, matches = run_round_robin(stage(tmp_path, pool), DRIVERS, settings, {DRIVERS[0].id})
    met = {frozenset(match.entrants) for match in matches}
    assert met == {frozenset((DRIVERS[0].id, other.id)) for other in DRIVERS[1:]}
    assert set(answer.tables["ranking"]["entrant"]) == {driver.id for driver in DRIVERS}
    assert answer.tables["ranking"]["entrant"][2] == DRIVERS[2].id
    with pytest.raises(InputError, match="references of the gauntlet"):
        run_round_robin(stage(tmp_path, pool), DRIVERS, settings)


@pytest.mark.parametrize("entrants", [[], DRIVERS[:1]])
def test_without_two_entrants_there_is_nothing_to_race(
    entrants: list[Entrant], tmp_path: Path, pool: Pool
) -> None:
    answer, matches = run_round_robin(stage(tmp_path, pool), entrants, TournamentSettings())
    assert (answer.entrants, matches) == ([], [])
    assert answer.tables["ranking"].equals(pl.DataFrame(schema=RANKING))
    assert answer.results.equals(pl.DataFrame(schema=RESULTS))


def test_the_barred_do_not_go_on() -> None:
    def ranking(barred: list[bool]) -> pl.DataFrame:
        rows = [
            {"entrant": entrant.id, "rank": rank, "barred": out}
            for entrant, rank, out in zip(DRIVERS, (1, 1, 3), barred, strict=True)
        ]
        return pl.DataFrame(rows, schema=RANKING)

    assert leaders(DRIVERS, ranking([False, False, False])) == DRIVERS[:2]
    assert leaders(DRIVERS, ranking([True, False, False])) == DRIVERS[1:2]
    assert leaders(DRIVERS, ranking([True, True, False])) == DRIVERS[2:]
    assert leaders(DRIVERS, ranking([True, True, True])) == []


@pytest.mark.parametrize(
    "field", [{"pairs": 1}, {"block": 1}, {"format": "3v3"}, {"effect": 0.0}, {"max_contacts_per_km": -1.0}]
)
def test_settings_out_of_range_are_refused(field: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        TournamentSettings.model_validate(field)

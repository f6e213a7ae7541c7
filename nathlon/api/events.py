"""`nathlon.endurance`, `nathlon.weekend` and `nathlon.season`: long races, and races that belong together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TypedDict, Unpack

import polars as pl

from nathlon.api.candidates import Candidates, with_cars
from nathlon.api.stints import stints
from nathlon.arena.entrance import enter_in_cars
from nathlon.arena.entrant import CAR, CIRCUIT, Entrant
from nathlon.arena.match import Match
from nathlon.arena.pool import Pool
from nathlon.arena.qualifying import qualify
from nathlon.arena.single_race import single_race
from nathlon.lab.events.chapters import (
    of_classes,
    practice_chapter,
    qualifying_chapter,
    race_chapter,
    season_chapter,
    stint_chapter,
)
from nathlon.lab.events.classes import class_names, grid_by_class
from nathlon.lab.events.race_folder import drive_race
from nathlon.lab.events.standings import Started, class_leaders, season_table, with_names
from nathlon.lab.stints.practice import with_settings
from nathlon.policies.sources import COMPOSITE, OBJECT
from nathlon.reports.event_page import lap_chapter, write_event_page
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.whole_file import check_output, whole_file, writing
from nathlon.terminal.progress import stage_progress, worker_count

PRACTICE, RACE = "practice", "race"
"""Stages as progress shows them."""
PRACTISED = {"name": pl.String, "plan": pl.String, "expected_s": pl.Float64, "reason": pl.String}
"""What is kept of practice."""


class EnduranceResult:
    """How a race by the clock went.

    Attributes:
        folder: of all that it has left: the page, `results.csv` and `laps.csv`, and the legs.
        results: RESULTS with `name`, `class`, `class_place` and `stops`, by place.
        laps: LAP_CHART with `name` and `class`.
        page: the path of its page.
    """

    def __init__(self, folder: Path, results: pl.DataFrame, laps: pl.DataFrame, page: Path) -> None:
        self.folder, self.results, self.laps, self.page = folder, results, laps, page

    def __repr__(self) -> str:
        return "\n".join(
            f"{row['place']:>3} {row['name']}: {row['laps']} laps, {row['stops']} stops"
            for row in self.results.iter_rows(named=True)
        )

    def _repr_html_(self) -> str:
        return self.results.select("place", "name", "laps", "stops", "ending", "points")._repr_html_()


class WeekendResult(EnduranceResult):
    """How a weekend went.

    Attributes:
        circuit: where.
        practice: `name`, `plan` (null without one), `expected_s`, and `reason` if practice came to none; None
            without practice.
        qualifying: `name`, `class` and `lap_s` (null without a time), from pole.
    """

    def __init__(
        self, race: EnduranceResult, circuit: str, practice: pl.DataFrame | None, qualifying: pl.DataFrame
    ) -> None:
        super().__init__(race.folder, race.results, race.laps, race.page)
        self.circuit, self.practice, self.qualifying = circuit, practice, qualifying


class WeekendOptions(TypedDict, total=False):
    """What the weekends of a season have in common; each as for `weekend`."""

    car: str
    laps: int
    scenario: str
    practice: bool
    workers: int | None
    progress: bool


class SeasonResult:
    """How a season went.

    Attributes:
        folder: of all that it has left, with a folder for each weekend.
        table: `class`, `place`, `name`, `points`, `wins`, and the points of each weekend by its circuit.
        weekends: in their order.
        page: the path of its page.
    """

    def __init__(
        self, folder: Path, table: pl.DataFrame, weekends: Sequence[WeekendResult], page: Path
    ) -> None:
        self.folder, self.table, self.weekends, self.page = folder, table, weekends, page

    def __repr__(self) -> str:
        return "\n".join(
            f"{row['place']:>3} {row['name']}: {row['points']:g} points"
            for row in self.table.iter_rows(named=True)
        )

    def _repr_html_(self) -> str:
        return self.table._repr_html_()


def endurance(
    entrants: Candidates,
    *,
    circuit: str = CIRCUIT,
    car: str = CAR,
    hours: float = 24.0,
    cars: int | None = None,
    scenario: str = "endurance",
    seed: int = 1,
    out: str | Path = "runs/endurance",
    progress: bool = True,
) -> EnduranceResult:
    """Run a race by the clock. When time is up, who has come furthest has won.

    The race is kept by the hour: called again with the same arguments it goes on where it was stopped, and
    ends as if it had not been.

    Args:
        entrants: checkpoints, composites with stints, `driver:pace=0.95` or `plugin:NAME`, from pole; each
            may name its car, as in `A.safetensors?car=prototype`. The fastest class starts in front.
        circuit: shipped name or path.
        car: of those who name none; likewise.
        hours: until the end, up to 24.
        cars: on the grid, which the entrants fill in turn; one for each by default.
        scenario: a race that ends by time.
        seed: of all randomness.
        out: folder for all that it leaves.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if one cannot drive, a name is unknown, there are more entrants than places, or the folder
            holds another race.
    """
    folder = Path(out)
    check_output(folder)
    with Pool(1) as pool, stage_progress(progress, (RACE,)) as on_match:
        entered = enter_in_cars(pool, with_cars(entrants, car), circuit)
        name = with_settings(scenario, cars=cars or len(entered), hours=hours)
        grid = grid_by_class(entered, load_scenario(name).cars)
        match = single_race(entered, name, seed, grid)
        event = f"{hours:g} hours of {circuit}"
        return _drive(pool, match, entered, folder, partial(on_match, RACE), event)


def weekend(
    entrants: Candidates,
    *,
    circuit: str = CIRCUIT,
    car: str = CAR,
    laps: int = 40,
    scenario: str = "weekend",
    practice: bool = True,
    seed: int = 1,
    workers: int | None = None,
    out: str | Path = "runs/weekend",
    progress: bool = True,
) -> WeekendResult:
    """Practice, qualifying that makes the grid, and a race.

    In practice each policy without a strategy gets a planner, as of `nathlon.stints`. Called again with the
    same arguments, a weekend that was stopped goes on with the practice or the hour of the race in which it
    was.

    Args:
        entrants: checkpoints, composites with stints, `driver:pace=0.95` or `plugin:NAME`, one car each,
            which they may name, as in `A.safetensors?car=prototype`.
        circuit: shipped name or path.
        car: of those who name none; likewise.
        laps: of the race.
        scenario: a race in laps.
        practice: whether there is any; without it, cars stop when they need to.
        seed: of all randomness.
        workers: processes.
        out: folder for all that it leaves.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if one cannot drive, a name is unknown, there are more entrants than places, or the folder
            holds another race.
    """
    folder = Path(out)
    check_output(folder)
    count = worker_count(workers)
    with Pool(count) as pool, stage_progress(progress, (PRACTICE, RACE)) as on_match:
        entered = enter_in_cars(pool, with_cars(entrants, car), circuit)
        name = with_settings(scenario, cars=len(entered), laps=laps)
        planned = (
            _practise(entered, name, seed, count, folder, partial(on_match, PRACTICE)) if practice else None
        )
        times = qualify(pool, entered, seed)
        order = [entered.index(entrant) for entrant, _ in times]
        starting = entered
        if planned is not None:
            given = dict(zip(planned["name"], planned["plan"], strict=True))
            plans = [(given[one.name] or one.source, one.car) for one in entered]
            starting = enter_in_cars(pool, plans, circuit)
        match = single_race([starting[index] for index in order], name, seed)
        entered = [entered[index] for index in order]
        qualifying = _qualifying(entered, [lap_s for _, lap_s in times])
        event = f"{laps} laps of {circuit}"
        race = _drive(pool, match, entered, folder, partial(on_match, RACE), event, qualifying, planned)
    return WeekendResult(race, circuit, planned, qualifying)


def season(
    entrants: Candidates,
    *,
    circuits: Sequence[str],
    seed: int = 1,
    out: str | Path = "runs/season",
    **options: Unpack[WeekendOptions],
) -> SeasonResult:
    """Weekends on several circuits, and a table of points.

    It goes on where it was stopped, as a weekend does.

    Args:
        entrants: as for `weekend`; all must be able to drive every circuit.
        circuits: shipped names or paths, each once.
        seed: of the first weekend; each other has the next.
        out: folder for all that it leaves.
        options: `car`, `laps`, `scenario`, `practice`, `workers` and `progress` of `weekend`.

    Raises:
        InputError: as for `weekend`; and if a circuit is named twice.
    """
    folder = Path(out)
    check_output(folder)
    if not circuits or len(set(circuits)) < len(circuits):
        raise InputError(f"circuits is {', '.join(circuits)!r}, expected one or more, each once")
    several = isinstance(entrants, Iterable) and not isinstance(entrants, str | Mapping)
    given: Candidates = list(entrants) if several else entrants  # type: ignore[arg-type]
    weekends = [
        weekend(
            given,
            circuit=circuit,
            seed=seed + number,
            out=folder / f"{number + 1}-{_short(circuit)}",
            **options,
        )
        for number, circuit in enumerate(circuits)
    ]
    table = season_table({one.circuit: one.results for one in weekends})
    _write_table(folder / "table.csv", table)
    chapters = [season_chapter(table, list(map(_short, circuits)))]
    for one in weekends:
        where = _short(one.circuit)
        own_page = one.page.relative_to(folder).as_posix()
        chapters.append(race_chapter(one.results, where)._replace(link=own_page))
        chapters.append(lap_chapter(one.laps, f"{where}: laps"))
    several = of_classes(table)
    won = [
        f"{name} wins the season{f' in {of_class}' if several else ''} with {points:g} points"
        for of_class, name, points in table.filter(place=1).select("class", "name", "points").iter_rows()
    ]
    page = write_event_page(folder, "; ".join(won), f"{len(weekends)} weekends", chapters)
    return SeasonResult(folder, table, weekends, page)


def _short(circuit: str) -> str:
    """The name of a circuit, or that of its folder or file."""
    path = Path(circuit)
    return path.parent.name if path.name == "circuit.toml" else path.stem


def _practise(
    entered: Sequence[Entrant],
    scenario: str,
    seed: int,
    workers: int,
    folder: Path,
    on_done: Callable[[int, int], None],
) -> pl.DataFrame:
    """A planner for each entrant that can have one, see `WeekendResult.practice`; written after each."""
    path = folder / "practice.csv"
    planned = _practised(path)
    if planned["name"].to_list() != [one.name for one in entered[: planned.height]]:
        raise InputError(f"{path}: is of other entrants, expected another folder")
    planned_for = load_scenario(scenario).wear_rate > 0.0
    for number, one in enumerate(entered[planned.height :], planned.height + 1):
        plan: str | None = None
        expected_s: float | None = None
        reason: str | None = None
        if planned_for and not one.source.endswith(COMPOSITE) and one.source.partition(":")[0] != OBJECT:
            place = folder / PRACTICE / f"{number:02}"
            try:
                found = stints(
                    one.source,
                    scenario=scenario,
                    circuit=one.circuit,
                    car=one.car,
                    seed=seed,
                    workers=workers,
                    out=place,
                    progress=False,
                )
                plan, expected_s = str(found.planner), found.table["expected_s"][0]
            except InputError as error:
                reason = str(error)
        row = (one.name, plan, expected_s, reason)
        planned = planned.vstack(pl.DataFrame([row], schema=PRACTISED, orient="row"))
        _write_table(path, planned)
        on_done(number, len(entered))
    return planned


def _practised(path: Path) -> pl.DataFrame:
    """What a weekend has practised so far, as it is kept in a file.

    Raises:
        InputError: if it is no such table.
    """
    if not path.is_file():
        return pl.DataFrame(schema=PRACTISED)
    try:
        return pl.read_csv(path, schema=PRACTISED)
    except (pl.exceptions.PolarsError, UnicodeDecodeError):
        columns = ", ".join(PRACTISED)
        raise InputError(
            f"{path}: expected a table with the columns {columns}; without this file practice begins anew"
        ) from None


def _qualifying(entered: Sequence[Entrant], laps_s: Sequence[float | None]) -> pl.DataFrame:
    """`name`, `class` and `lap_s` of entrants from pole."""
    called = class_names([one.car for one in entered])
    rows = [(one.name, called[one.car], lap_s) for one, lap_s in zip(entered, laps_s, strict=True)]
    return pl.DataFrame(rows, {"name": pl.String, "class": pl.String, "lap_s": pl.Float64}, orient="row")


def _drive(
    pool: Pool,
    match: Match,
    entered: Sequence[Entrant],
    folder: Path,
    on_leg: Callable[[int, int], None],
    event: str,
    qualifying: pl.DataFrame | None = None,
    practice: pl.DataFrame | None = None,
) -> EnduranceResult:
    """Drive the race of a match, and write its tables and page.

    Args:
        entered: those of the match.
        qualifying, practice: what was before it, as of `WeekendResult`.
    """
    driven = drive_race(pool, match, folder / "legs", on_leg)
    called = class_names([one.car for one in entered])
    on_grid = [entered[seat.entrant] for seat in match.races[0].seats]
    results, laps = with_names(driven, [Started(one.name, called[one.car]) for one in on_grid])
    _write_table(folder / "results.csv", results)
    _write_table(folder / "laps.csv", laps)
    winner = results.row(0, named=True)
    headline = f"{winner['name']} wins after {winner['laps']} laps"
    if of_classes(results):
        _, *others = class_leaders(results).items()
        headline += "".join(f"; {name} is the first of {car_class}" for car_class, name in others)
    chapters = [race_chapter(results, "Race"), lap_chapter(laps, "Laps"), stint_chapter(laps)]
    chapters += [] if qualifying is None else [qualifying_chapter(qualifying)]
    chapters += [] if practice is None else [practice_chapter(practice, results)]
    page = write_event_page(folder, headline, event, chapters)
    return EnduranceResult(folder, results, laps, page)


def _write_table(path: Path, table: pl.DataFrame) -> None:
    """Write a table as CSV, whole or not at all, into a folder that is made if need be."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as whole:
            table.write_csv(whole)

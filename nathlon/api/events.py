"""`nathlon.endurance`, `nathlon.weekend` and `nathlon.season`: long races, and races that belong together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TypedDict, Unpack

import polars as pl

from nathlon.api.candidates import Candidates, named_sources
from nathlon.api.stints import stints
from nathlon.arena.entrance import enter_all
from nathlon.arena.entrant import CAR, CIRCUIT, Entrant
from nathlon.arena.pool import Pool
from nathlon.arena.qualifying import qualify
from nathlon.arena.single_race import single_race
from nathlon.lab.events.race_folder import RaceDriven, drive_race
from nathlon.lab.events.standings import lap_times, season_table, with_names
from nathlon.lab.stints.practice import with_settings
from nathlon.policies.sources import COMPOSITE, OBJECT
from nathlon.reports.event_page import Chapter, lap_chapter, table_chapter, write_event_page
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.whole_file import check_output, whole_file, writing
from nathlon.terminal.progress import stage_progress, worker_count

PRACTICE, RACE = "practice", "race"
"""Stages as progress shows them."""


class EnduranceResult:
    """How a race by the clock went.

    Attributes:
        folder: of all that it has left: the page, `results.csv` and `laps.csv`, and the legs.
        results: RESULTS with `name` and `stops`, by place.
        laps: LAP_CHART with `name`.
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
        practice: `name`, `plan` (null without one), `expected_s`; None without practice.
        qualifying: `name` and `lap_s` (null without a time), from pole.
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
        table: `place`, `name`, `points`, `wins`, and the points of each weekend by its circuit.
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
        entrants: checkpoints, composites with stints, `driver:pace=0.95` or `plugin:NAME`, from pole.
        circuit, car: shipped names or paths.
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
        entered = enter_all(pool, named_sources(entrants), circuit, car)
        name = with_settings(scenario, cars=cars or len(entered), hours=hours)
        driven = _race(pool, entered, name, circuit, car, seed, folder, partial(on_match, RACE))
    names = [entrant.name for entrant in entered]
    return _write(folder, driven, names, f"{hours:g} hours of {circuit}", [])


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
        entrants: checkpoints, composites with stints, `driver:pace=0.95` or `plugin:NAME`, one car each.
        circuit, car: shipped names or paths.
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
        entered = enter_all(pool, named_sources(entrants), circuit, car)
        name = with_settings(scenario, cars=len(entered), laps=laps)
        planned = (
            _practise(entered, name, circuit, car, seed, count, folder, partial(on_match, PRACTICE))
            if practice
            else None
        )
        times = qualify(pool, entered, circuit, car, seed)
        order = [entered.index(entrant) for entrant, _ in times]
        starting = entered
        if planned is not None:
            given = dict(zip(planned["name"], planned["plan"], strict=True))
            starting = enter_all(pool, [given[one.name] or one.source for one in entered], circuit, car)
        grid = [starting[index] for index in order]
        driven = _race(pool, grid, name, circuit, car, seed, folder, partial(on_match, RACE))
    names = [entered[index].name for index in order]
    qualifying = pl.DataFrame(
        {"name": names, "lap_s": [lap_s for _, lap_s in times]},
        schema={"name": pl.String, "lap_s": pl.Float64},
    )
    chapters = [table_chapter("Qualifying", _qualifying_rows(qualifying), ("Place", "Entrant", "Lap"))]
    race = _write(folder, driven, names, f"{laps} laps of {circuit}", chapters)
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
            out=folder / f"{number + 1}-{Path(circuit).stem}",
            **options,
        )
        for number, circuit in enumerate(circuits)
    ]
    table = season_table({one.circuit: one.results for one in weekends})
    _write_table(folder / "table.csv", table)
    heads = ("Place", "Entrant", "Points", "Wins", *(Path(circuit).stem for circuit in circuits))
    rows = [[_cell(value) for value in row] for row in table.iter_rows()]
    chapters = [table_chapter("Table", rows, heads)]
    for one in weekends:
        chapters.append(_race_chapter(one.results, Path(one.circuit).stem))
        chapters.append(lap_chapter(one.laps, f"{Path(one.circuit).stem}: laps"))
    leader = table.row(0, named=True)
    headline = f"{leader['name']} wins the season with {leader['points']:g} points"
    page = write_event_page(folder, headline, f"{len(weekends)} weekends", chapters)
    return SeasonResult(folder, table, weekends, page)


def _race(
    pool: Pool,
    grid: Sequence[Entrant],
    scenario: str,
    circuit: str,
    car: str,
    seed: int,
    folder: Path,
    on_leg: Callable[[int, int], None],
) -> RaceDriven:
    return drive_race(pool, single_race(grid, scenario, circuit, car, seed), folder / "legs", on_leg)


def _practise(
    entered: Sequence[Entrant],
    scenario: str,
    circuit: str,
    car: str,
    seed: int,
    workers: int,
    folder: Path,
    on_done: Callable[[int, int], None],
) -> pl.DataFrame:
    """A planner for each entrant that can have one: `name`, `plan`, `expected_s`."""
    path = folder / "practice.csv"
    schema = {"name": pl.String, "plan": pl.String, "expected_s": pl.Float64}
    if path.is_file():
        kept = pl.read_csv(path, schema=schema)
        if kept["name"].to_list() == [one.name for one in entered]:
            return kept
        raise InputError(f"{path}: is of other entrants, expected another folder")
    rows: list[tuple[str, str | None, float | None]] = []
    raced = load_scenario(scenario)
    planned_for = raced.wear_rate > 0.0 and not raced.weather
    for number, one in enumerate(entered):
        if not planned_for or one.source.endswith(COMPOSITE) or one.source.partition(":")[0] == OBJECT:
            rows.append((one.name, None, None))
        else:
            place = folder / PRACTICE / f"{number + 1:02}"
            try:
                found = stints(
                    one.source,
                    scenario=scenario,
                    circuit=circuit,
                    car=car,
                    seed=seed,
                    workers=workers,
                    out=place,
                    progress=False,
                )
                best = found.table.row(0, named=True)
                rows.append((one.name, str(found.planner), best["expected_s"]))
            except InputError:
                # Who does not come round in practice races without a plan.
                rows.append((one.name, None, None))
        on_done(number + 1, len(entered))
    planned = pl.DataFrame(rows, schema=schema, orient="row")
    _write_table(path, planned)
    return planned


def _write(
    folder: Path, driven: RaceDriven, names: Sequence[str], event: str, before: Sequence[Chapter]
) -> EnduranceResult:
    """Tables and page of a race that is over."""
    results, laps = with_names(driven, names)
    _write_table(folder / "results.csv", results)
    _write_table(folder / "laps.csv", laps)
    winner = results.row(0, named=True)
    headline = f"{winner['name']} wins after {winner['laps']} laps"
    chapters = [_race_chapter(results, "Race"), lap_chapter(laps, "Laps"), _stint_chapter(laps), *before]
    page = write_event_page(folder, headline, event, chapters)
    return EnduranceResult(folder, results, laps, page)


def _write_table(path: Path, table: pl.DataFrame) -> None:
    """Write a table as CSV, whole or not at all, into a folder that is made if need be."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as whole:
            table.write_csv(whole)


def _race_chapter(results: pl.DataFrame, title: str) -> Chapter:
    heads = (
        "Place",
        "Entrant",
        "Laps",
        "km",
        "Time",
        "Best lap",
        "Stops",
        "Contacts",
        "Pen.",
        "Ending",
        "Points",
    )
    rows = [
        [
            *(str(row["place"]), row["name"], str(row["laps"]), f"{row['distance_m'] / 1000:.1f}"),
            *(_seconds(row["race_time_s"]), _seconds(row["best_lap_s"]), str(row["stops"])),
            *(str(row["contacts"]), str(row["penalties"])),
            *(row["ending"].replace("_", " "), _cell(row["points"])),
        ]
        for row in results.iter_rows(named=True)
    ]
    return table_chapter(title, rows, heads)


def _stint_chapter(laps: pl.DataFrame) -> Chapter:
    heads = ("Entrant", "Stint", "Compound", "Laps", "Best lap", "Mean lap")
    rows = [
        [name, str(stint), compound, f"{first} to {last}", _seconds(best_s), _seconds(mean_s)]
        for name, stint, compound, first, last, best_s, mean_s in lap_times(laps).iter_rows()
    ]
    return table_chapter("Stints", rows, heads)


def _qualifying_rows(qualifying: pl.DataFrame) -> list[list[str]]:
    return [
        [str(place), name, _seconds(lap_s) or "no time"]
        for place, (name, lap_s) in enumerate(qualifying.iter_rows(), 1)
    ]


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:,.3f}"


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, float) else str(value)

"""How good the champions are: alone against the limit and the driver, and from the back of the grid.

`python -m benchmarks.champions --json FILE [--circuit NAME ...] [--races N] [--seed N] [--workers N]
[CHECKPOINT ...]` measures
checkpoints, or folders of them, on the circuit and in the car of their cards. Without any it takes the
bundled champions: those that `policies/bundled/champions.toml` names, or the last checkpoint of every
bundled run where there is no such file. Races run side by side in N processes, as many as there are cores if
it is not given; the figures do not depend on it.

The JSON has, by circuit and car, `limit_s` (the fastest lap by optimal control, see `benchmarks.lap_limit`,
null where it is not known), the built-in driver's figures under `driver`, and each checkpoint's under
`champions`, by name. The driver is measured as if it were a champion: in races it takes a champion's place.

- `lap_s`, `best_lap_s`: median and best of the faster of two laps from each of 8 rolling starts, which is the
  second, a flying one; null where half of the starts or all gave none; `clean_starts`, from how many nothing
  was driven off the course; `off_course_share`, of the time driven;
- `limit_ratio`, `driver_ratio`: `lap_s` over the limit, and over the driver's from the same starts;
- `races`, `finished`, `wins_from_back`, `mean_place`: from the last place of the grid of the scenario `race`
  (eight cars, standing start, two laps, penalties) against seven built-in drivers at full pace; `wins_low`
  and `wins_high` are Wilson's 95 % interval;
- `by_pace`: `wins`, `mean_place` and `at_fault_per_km` of as many such races against seven built-in drivers
  of each lower pace;
- `seven_laps`: likewise by pace, of races of seven laps, as long as those in which GT Sophy's ablations were
  compared;
- `contacts_per_km`, `at_fault_per_km`: contacts with other cars in those races, and those that the stewards
  laid to the champion, each with its 95 % interval: a bootstrap over races, nowhere shorter than counting
  allows.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.special import gammaincinv
from scipy.stats import binomtest

from benchmarks.result import write_result
from benchmarks.time_trial import FLYING, TimeTrial, drive_alone, limits
from nathlon.arena.entrant import Entrant, enter, only_once
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import run_matches
from nathlon.arena.results import VOID_ENDINGS
from nathlon.arena.statistics import interval, spread
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import read_card
from nathlon.policies.sources import DRIVER
from nathlon.policies.sources.finding import find_sources
from nathlon.sim.data_file import Section, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario

CHAMPIONS = BUNDLED / "champions.toml"
RACE = "race"
RACES = 10
PACES = (0.95, 0.88)
"""Of built-in drivers slower than at full pace."""
LONG_RACE = str(Path(__file__).with_name("seven_laps.toml"))
LONG_PACES = (1.0, 0.95)
"""Of built-in drivers in races of seven laps."""
SEED = 4711
CONFIDENCE = 0.95
RESAMPLES = 2000
WIDTH = 220
"""Of the printed tables, in characters."""

Figures = dict[str, Any]


class Champions(Section):
    """The names of the bundled champions, files of `policies/bundled` without their suffix."""

    names: tuple[str, ...]


def bundled_champions() -> list[Path]:
    """The checkpoints that stand for what comes with nathlon.

    Raises:
        InputError: if the file that names them cannot be read.
    """
    if CHAMPIONS.exists():
        names = read_toml(CHAMPIONS, Champions, "champions").names
        return [BUNDLED / f"{name}.safetensors" for name in names]
    last: dict[str, Path] = {}
    for path in sorted(BUNDLED.rglob("*.safetensors"), key=lambda path: read_card(path).step):
        last[path.stem.rpartition("-")[0]] = path
    return list(last.values())


def entrants_of(paths: Sequence[Path], circuits: Sequence[str]) -> dict[tuple[str, str], list[Entrant]]:
    """Entrants by circuit and car, as their cards say, of the circuits given or of all.

    Raises:
        InputError: if a checkpoint cannot drive, or there is none for one of the circuits.
    """
    sources: dict[tuple[str, str], list[str]] = {}
    for path in paths:
        card = read_card(path)
        if not circuits or card.circuit in circuits:
            sources.setdefault((card.circuit, card.car), []).append(str(path))
    for circuit in circuits:
        if circuit not in {known for known, _ in sources}:
            raise InputError(f"circuit {circuit}: no checkpoint for it, expected at least one")
    return {
        where: only_once([enter(source, *where) for source in found])
        for where, found in sorted(sources.items())
    }


def alone(laps: TimeTrial, limit_s: float | None, driver: TimeTrial) -> Figures:
    """Figures of a time trial."""
    return {
        "lap_s": _number(laps.lap_s, 3),
        "best_lap_s": _number(laps.best_s, 3),
        "clean_starts": laps.clean,
        "off_course_share": round(laps.off_course_share, 5),
        "limit_ratio": _number(laps.lap_s / limit_s, 4) if limit_s else None,
        "driver_ratio": _number(laps.lap_s / driver.lap_s, 4),
    }


def race_match(
    entrant: Entrant, races: int, driver: str = DRIVER, scenario: str = RACE, seed: int = SEED
) -> Match:
    """Races of an entrant from the last place, all others are the same built-in driver."""
    seats = (*[Seat(1)] * (load_scenario(scenario).cars - 1), Seat(0))
    return Match(
        "race",
        RACE,
        scenario,
        entrant.circuit,
        entrant.car,
        (entrant.id, driver),
        (entrant.source, driver),
        tuple(Race(seed + race, seats) for race in range(races)),
    )


def from_the_back(rows: pl.DataFrame, rng: np.random.Generator) -> Figures:
    """Figures of an entrant's RESULTS, one row a race; races with a fault of the simulator are void."""
    rows = rows.filter(~pl.col("ending").is_in(VOID_ENDINGS))
    came = places(rows)
    share = binomtest(came["wins"], rows.height).proportion_ci(CONFIDENCE, "wilson")
    km = rows["distance_m"].to_numpy() / 1000
    figures = {
        "races": rows.height,
        "finished": rows.filter(pl.col("ending") == "finished").height,
        "wins_from_back": came["wins"],
        "wins_low": round(share.low * rows.height, 2),
        "wins_high": round(share.high * rows.height, 2),
        "mean_place": came["mean_place"],
    }
    for name, column in (("contacts", "contacts"), ("at_fault", "contacts_at_fault")):
        rate, low, high = rate_interval(rows[column].to_numpy().astype(np.float64), km, rng)
        figures |= {f"{name}_per_km": _number(rate, 3), f"{name}_low": _number(low, 3)}
        figures[f"{name}_high"] = _number(high, 3)
    return figures


def places(rows: pl.DataFrame) -> Figures:
    """Wins, mean place and contacts at fault of an entrant's RESULTS, without void races."""
    rows = rows.filter(~pl.col("ending").is_in(VOID_ENDINGS))
    finished = pl.col("ending") == "finished"
    wins = rows.filter(finished & (pl.col("place") == 1)).height
    at_fault, way_m = (float(rows[name].to_numpy().sum()) for name in ("contacts_at_fault", "distance_m"))
    return {
        "wins": wins,
        "mean_place": float(rows["place"].to_numpy().mean()),
        "at_fault_per_km": round(1000 * at_fault / way_m, 3) if way_m > 0.0 else None,
    }


def rate_interval(
    events: NDArray[np.float64], km: NDArray[np.float64], rng: np.random.Generator
) -> tuple[float, float, float]:
    """Events a kilometre over some races, (races,) each, and the bounds of its interval; nan without a way.

    The interval resamples races, the ratio made linear at its value, and is nowhere shorter than
    Poisson counting alone allows.
    """
    total, way = events.sum(), km.sum()
    if way <= 0.0:
        return math.nan, math.nan, math.nan
    rate, races = total / way, len(km)
    spreads = spread(events - rate * km, np.array([races]), RESAMPLES, rng)
    low, high = interval(np.array([rate]), np.array([[races / way]]), spreads, CONFIDENCE)
    tail = (1 - CONFIDENCE) / 2
    fewest = gammaincinv(total, tail) / way if total else 0.0
    most = gammaincinv(total + 1, 1 - tail) / way
    return float(rate), float(max(np.fmin(low[0], fewest), 0.0)), float(np.fmax(high[0], most))


def _number(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None


def all_matches(entrant: Entrant, races: int, seed: int) -> dict[tuple[str, float], Match]:
    """Races of an entrant from the back, by the scenario and the pace of the drivers."""
    wanted = [(RACE, 1.0), *((RACE, pace) for pace in PACES), *((LONG_RACE, pace) for pace in LONG_PACES)]
    return {
        (scenario, pace): race_match(
            entrant, races, DRIVER if pace == 1.0 else f"{DRIVER}:pace={pace}", scenario, seed
        )
        for scenario, pace in wanted
    }


def race_all(matches: Sequence[Match], workers: int, title: str, console: Console) -> dict[str, pl.DataFrame]:
    """RESULTS of the car that starts last in each match, by the match's key."""
    ended = track(run_matches(matches, workers), title, len(matches), console=console)
    return {match.key: rows.filter(pl.col("slot") == pl.col("slot").max()) for match, rows in ended}


def measure(
    entrants: dict[tuple[str, str], list[Entrant]], races: int, seed: int, workers: int, console: Console
) -> dict[str, dict[str, Figures]]:
    """All figures by circuit and car."""
    measured: dict[str, dict[str, Figures]] = {}
    for (circuit, car), those in entrants.items():
        limit_s = limits().get((circuit, car))
        everybody = [enter(DRIVER, circuit, car), *those]
        laps = [drive_alone(entrant, FLYING) for entrant in everybody]
        matches = [all_matches(entrant, races, seed) for entrant in everybody]
        raced = race_all(
            [match for own in matches for match in own.values()], workers, f"{circuit}, {car}", console
        )
        figures = []
        for own_laps, own in zip(laps, matches, strict=True):
            rows = {which: raced[match.key] for which, match in own.items()}
            figures.append(
                {
                    **alone(own_laps, limit_s, laps[0]),
                    **from_the_back(rows[RACE, 1.0], np.random.default_rng(seed)),
                    "by_pace": {str(pace): places(rows[RACE, pace]) for pace in PACES},
                    "seven_laps": {str(pace): places(rows[LONG_RACE, pace]) for pace in LONG_PACES},
                }
            )
        measured.setdefault(circuit, {})[car] = {
            "limit_s": limit_s,
            "driver": figures[0],
            "champions": dict(zip((entrant.name for entrant in those), figures[1:], strict=True)),
        }
    return measured


def table(circuit: str, car: str, figures: Figures) -> Table:
    """The figures of one circuit and car for people."""
    limit = "not known" if figures["limit_s"] is None else f"{figures['limit_s']:.3f} s"
    rendered = Table(
        "",
        *("lap, s", "best, s", "/ limit", "/ driver", "off course"),
        *(
            "wins of races",
            "place",
            *(f"place at {pace}" for pace in PACES),
            *(f"7 laps at {pace}" for pace in LONG_PACES),
            "contacts / km",
            "at fault / km",
        ),
        title=f"{circuit}, {car}: limit {limit}",
        title_justify="left",
        box=box.MARKDOWN,
    )
    for name, entrant in [("built-in driver", figures["driver"]), *figures["champions"].items()]:
        wins = f"{entrant['wins_from_back']} of {entrant['races']}"
        rendered.add_row(
            name,
            *_alone_cells(entrant),
            f"{wins} ({entrant['wins_low']:.1f}-{entrant['wins_high']:.1f})",
            f"{entrant['mean_place']:.1f}",
            *(f"{other['mean_place']:.1f}" for other in entrant["by_pace"].values()),
            *(f"{long['mean_place']:.1f}, {long['wins']} won" for long in entrant["seven_laps"].values()),
            _rate_cell(entrant, "contacts"),
            _rate_cell(entrant, "at_fault"),
        )
    return rendered


def _alone_cells(figures: Figures) -> list[str]:
    cells = [figures[name] for name in ("lap_s", "best_lap_s", "limit_ratio", "driver_ratio")]
    return [*("" if cell is None else f"{cell:.3f}" for cell in cells), f"{figures['off_course_share']:.2%}"]


def _rate_cell(figures: Figures, name: str) -> str:
    rate, low, high = (figures[f"{name}_{part}"] for part in ("per_km", "low", "high"))
    return "" if rate is None else f"{rate:.2f} ({low:.2f}-{high:.2f})"


def main() -> None:
    """Measure, write the JSON, print the tables."""
    parser = argparse.ArgumentParser(prog="benchmarks.champions", description="How good the champions are")
    parser.add_argument("checkpoints", nargs="*", type=Path, help="or folders of them; default: bundled ones")
    parser.add_argument("--json", type=Path, required=True, help="file for the figures")
    parser.add_argument("--circuit", nargs="+", action="extend", default=[], help="measure only these")
    parser.add_argument("--races", type=int, default=RACES, help="at each pace and length")
    parser.add_argument("--seed", type=int, default=SEED, help="of the first race")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    chosen = parser.parse_args()
    try:
        paths = list(map(Path, find_sources(chosen.checkpoints))) or bundled_champions()
        entrants = entrants_of(paths, chosen.circuit)
        measured = measure(entrants, chosen.races, chosen.seed, chosen.workers, Console(stderr=True))
    except InputError as error:
        parser.error(str(error))
    write_result(chosen.json, measured)
    for circuit, cars in measured.items():
        for car, figures in cars.items():
            Console(width=WIDTH).print(table(circuit, car, figures))


if __name__ == "__main__":
    main()

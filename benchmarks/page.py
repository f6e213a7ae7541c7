"""The page of current figures, docs/benchmarks.md, made of the results in `benchmarks/results/`.

`python -m benchmarks.page` writes it; with `--check` it writes nothing and ends with 1 where the page is not
what the results give. What the page says stands in `page.md.jinja`; every figure on it comes from a result.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from benchmarks.result import RESULTS, Result, read_result
from nathlon.results.words import stage_called
from nathlon.sim.whole_file import whole_file

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "benchmarks.md"
TEMPLATE = "page.md.jinja"

Figures = Mapping[str, Any]


def count(value: float) -> str:
    """A number with commas between thousands, as it was rounded."""
    return f"{value:,}"


def percent(share: float, digits: int = 2) -> str:
    """A share as a percentage."""
    return f"{share:.{digits}%}".replace("%", " %")


def met(reached: bool) -> str:
    """Whether a goal is."""
    return "reached" if reached else "missed"


def place_and_wins(came: Figures) -> str:
    """Mean place and wins of some races; with no more than a rate, nothing."""
    wins = came.get("wins", came.get("wins_from_back"))
    return "" if wins is None else f"{came['mean_place']:.1f}, {wins}"


def rate(rate: float | None, low: float | None, high: float | None) -> str:
    """A rate a kilometre with its interval, where it has one."""
    if rate is None:
        return ""
    return f"{rate:.2f}" if low is None else f"{rate:.2f} ({low:.2f} to {high:.2f})"


def each_car(figures: Figures) -> list[tuple[str, str, Figures]]:
    """Circuit, car and what was measured there, of figures by circuit and car."""
    return [(circuit, car, those) for circuit, cars in figures.items() for car, those in cars.items()]


def spread(value: Sequence[float] | None) -> str:
    """A mean and its standard deviation."""
    return "" if value is None else f"{value[0]} ± {value[1]}"


def sessions(results: Mapping[str, Result], names: Sequence[str]) -> list[Figures]:
    """The figures of several runs of `benchmarks.champions`, by circuit and car each."""
    return [results[name].figures for name in names]


def pooled(runs: Sequence[Figures], circuit: str, car: str, name: str) -> dict[str, int]:
    """Wins of a checkpoint over all races of some runs, by laps and pace, and how many races that were."""
    there = [run[circuit][car]["champions"][name] for run in runs]
    return {
        "races": sum(run["races"] for run in there),
        "7 at 1.0": sum(run["seven_laps"]["1.0"]["wins"] for run in there),
        "7 at 0.95": sum(run["seven_laps"]["0.95"]["wins"] for run in there),
        "2 at 1.0": sum(run["wins_from_back"] for run in there),
        "2 at 0.95": sum(run["by_pace"]["0.95"]["wins"] for run in there),
    }


def mean_of(values: Iterable[float]) -> float:
    """The mean."""
    return fmean(values)


def middle_and_ends(three: Sequence[float], digits: int) -> str:
    """A median with the tenth and ninetieth percentile."""
    middle, low, high = (f"{value:,.{digits}f}" for value in three)
    return f"{middle} ({low} to {high})"


def signed(figures: Figures, name: str, digits: int) -> str:
    """A difference with its interval."""
    value, low, high = (figures[name + end] for end in ("", "_low", "_high"))
    return f"{value:+.{digits}f} ({low:+.{digits}f} to {high:+.{digits}f})"


def verdicts(kind: Figures) -> str:
    """Coverage, false ranks with their interval, and how often the best is among the first, as cells."""
    low, high = percent(kind["false_accept_low"], 1), percent(kind["false_accept_high"], 1)
    false = f"{percent(kind['false_accept'], 1)} ({low} to {high})"
    return f"{percent(kind['coverage'], 1)} | {false} | {percent(kind['best_kept'], 1)}"


def less(compared: Figures | None) -> str:
    """A difference of means with its interval, and the other's steps; nothing where it is the same one."""
    if compared is None or compared["verdict"] == "same":
        return ""
    low, high = compared["low"], compared["high"]
    return f"{compared['difference']:+.2f} ({low:+.2f} to {high:+.2f}), step {compared['steps']:,}"


def tally(worlds: Figures, name: str) -> str:
    """How often each verdict came, over all worlds and runs."""
    verdicts = [run[name]["verdict"] for runs in worlds.values() for run in runs.values() if run[name]]
    told = {"win": "won", "tie": "tied", "loss": "lost", "same": "the same checkpoint"}
    return ", ".join(f"{verdicts.count(verdict)} {word}" for verdict, word in told.items())


def foreseen(told: Sequence[float], digits: int = 0) -> str:
    """A forecast and its outcome."""
    expected, came = told
    return f"{expected:,.{digits}f} → {came:,.{digits}f}"


def in_all(night: Figures, name: str) -> list[float]:
    """Forecast and outcome of all stages together."""
    stages = [stage[name] for stage in night["stages"].values()]
    return [sum(stage[side] for stage in stages) for side in (0, 1)]


def page(results: Mapping[str, Result]) -> str:
    """The page, from results by name."""
    environment = Environment(
        loader=FileSystemLoader(HERE),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # Markdown
    )
    environment.filters |= {
        "count": count,
        "percent": percent,
        "met": met,
        "place_and_wins": place_and_wins,
        "each_car": each_car,
        "spread": spread,
        "signed": signed,
        "verdicts": verdicts,
        "less": less,
        "tally": tally,
        "foreseen": foreseen,
        "in_all": in_all,
        "stage_called": stage_called,
    }
    environment.globals |= {
        "rate": rate,
        "pooled": pooled,
        "sessions": sessions,
        "middle_and_ends": middle_and_ends,
        "mean_of": mean_of,
    }
    return environment.get_template(TEMPLATE).render(results=results)


def main() -> None:
    """Write the page, or compare it."""
    parser = argparse.ArgumentParser(prog="benchmarks.page", description="The page of current figures")
    parser.add_argument("--check", action="store_true", help="only compare the page with the results")
    check = parser.parse_args().check
    made = page({path.stem: read_result(path) for path in sorted(RESULTS.glob("*.json"))})
    if not check:
        with whole_file(PAGE) as partial:
            partial.write_text(made, "utf-8")
    elif PAGE.read_text("utf-8") != made:
        print(f"{PAGE.name} is not what the results give: run python -m benchmarks.page", file=sys.stderr)
        raise SystemExit(1)


if __name__ == "__main__":
    main()

"""What parts of the method are worth: policies trained without them race those trained with all.

`python -m benchmarks.ablation train [--out DIR] [--part K --parts N]` trains the `racing` configuration and
`VARIANTS` of it over `UPDATES` updates with each of `SEEDS`, as `nathlon ablate` does, but for those whose
last checkpoint and curve lie in `RUNS`; what has ended is put there. N such commands share the runs.

`python -m benchmarks.ablation [--pairs N] [--json FILE] [--figure FILE]` races the last checkpoint of each
variant, 4v4 over seven laps, against that of the base with the same seed. By variant:

- `seeds`: how many there are;
- `points`: of the variant's team a race less those of the base's, with a 95 % interval: Student's t over
  seeds, or of one seed a bootstrap over pairs;
- `at_fault_per_km`, `base_at_fault_per_km`: contacts that the stewards laid to cars of the variant and of
  the base, a kilometre driven by one, with Student's t intervals over seeds (null with one seed);
- `lap_s`, `off_course_share`: of the last evaluations in training, means over seeds; lap_s is null where one
  has no lap.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
import torch
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import Progress, track
from scipy.stats import t as student_t

from benchmarks.result import RESULTS, write_result
from nathlon.arena.entrant import enter
from nathlon.arena.match import Match
from nathlon.arena.pool import run_matches
from nathlon.policies.training.ablation import BASE, AblationRun, configurations, plan
from nathlon.policies.training.config import CONFIGS, TrainingConfig, read_config
from nathlon.policies.training.log import Status
from nathlon.selection.round_robin import plan as fixtures
from nathlon.sim.data_file import find_data
from nathlon.sim.whole_file import whole_file
from nathlon.tournament.event import Event, EventRace
from nathlon.tournament.points import matchups

RUNS = RESULTS / "ablation"
VARIANTS = ("no-quantiles", "n-step-1", "one-table", "no-passing-reward", "no-skill-scenarios")
SEEDS, UPDATES = 3, 32_000
SCENARIO = str(Path(__file__).with_name("seven_laps.toml"))
CONFIDENCE = 0.95
LEFT = ("curve.csv", f"checkpoints/step-{UPDATES:07d}.safetensors")
"""What is kept of a run."""
GREY = "#8b9096"


def base() -> TrainingConfig:
    """What all of them are compared with."""
    config = read_config(find_data("racing", "training configuration", CONFIGS))
    return config.model_copy(update={"updates": UPDATES})


def runs(folder: Path) -> list[AblationRun]:
    """All runs, in a folder; base and variants of the first seed first."""
    return plan(configurations(base(), VARIANTS), SEEDS, folder)


def ended(run: AblationRun) -> bool:
    """Whether what it left is all there."""
    return all((run.folder / name).exists() for name in LEFT)


def train(out: Path, part: int, parts: int) -> None:
    """Train those that are missing, and keep what they leave."""
    torch.set_num_threads(1)
    kept = [run for run in runs(RUNS) if not ended(run)]
    there = {str(run): run for run in runs(out)}
    with Progress(console=Console(stderr=True)) as progress:
        for run in kept[part::parts]:
            task = progress.add_task(str(run), total=UPDATES)

            def on_status(status: Status, task: Any = task) -> None:
                progress.update(task, completed=status.updates)

            there[str(run)].trainer().run(on_status)
            for name in LEFT:
                (run.folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(there[str(run)].folder / name, run.folder / name)


class Duel(NamedTuple):
    """A variant against the base with the same seed.

    Attributes:
        run: of the variant.
        entrant: its id.
        match: the races.
    """

    run: AblationRun
    entrant: str
    match: Match


def duels(pairs: int) -> Iterator[Duel]:
    """A match for each run of a variant that has ended, if the base's has."""
    found = [run for run in runs(RUNS) if ended(run)]
    bases = {run.seed: run for run in found if run.variant == BASE}
    for run in found:
        if run.variant == BASE or run.seed not in bases:
            continue
        config = run.config
        sides = [
            enter(str(each.last_checkpoint), config.circuit, config.car) for each in (run, bases[run.seed])
        ]
        race = EventRace(name="4v4", circuit=config.circuit, car=config.car, scenario=SCENARIO)
        [fixture] = fixtures(Event(race=(race,)), [sides], pairs, np.random.SeedSequence(run.seed))
        yield Duel(run, sides[0].id, fixture.match(slice(None)))


def judge(variant: str, raced: list[tuple[Duel, pl.DataFrame]]) -> dict[str, Any]:
    """The figures of a variant."""
    own = [(duel, results) for duel, results in raced if duel.run.variant == variant]
    tables = [
        matchups(results, np.random.default_rng(duel.run.seed)).filter(pl.col("entrant") == duel.entrant)
        for duel, results in own
    ]
    points = [table["difference"].item() for table in tables]
    low, high = t_interval(points) or tables[0].select("difference_low", "difference_high").row(0)
    figures: dict[str, Any] = {
        "seeds": len(own),
        "points": round(float(np.mean(points)), 2),
        "points_low": round(low, 2),
        "points_high": round(high, 2),
        "points_by_seed": [round(each, 2) for each in points],
    }
    for name, mine in (("at_fault_per_km", True), ("base_at_fault_per_km", False)):
        rates = [_at_fault(results, duel.entrant, mine) for duel, results in own]
        bounds = t_interval(rates) or (None, None)
        figures[name] = round(float(np.mean(rates)), 4)
        for end, bound in zip(("low", "high"), bounds, strict=True):
            figures[f"{name}_{end}"] = None if bound is None else round(max(bound, 0.0), 4)
    return figures | training_end([duel.run for duel, _ in own])


def training_end(found: list[AblationRun]) -> dict[str, Any]:
    """Lap and time off course of the last evaluations of some runs."""
    last = [pl.read_csv(run.curve, null_values="nan").tail(1) for run in found]
    laps = [row["lap_s"].item() for row in last]
    return {
        "lap_s": None if None in laps else round(float(np.mean(laps)), 3),
        "off_course_share": round(float(np.mean([row["off_course_share"].item() for row in last])), 4),
    }


def _at_fault(results: pl.DataFrame, entrant: str, own: bool) -> float:
    side = results.filter((pl.col("entrant") == entrant) == own)
    contacts, metres = (side[name].to_numpy().sum() for name in ("contacts_at_fault", "distance_m"))
    return float(1000 * contacts / metres)


def t_interval(values: list[float]) -> tuple[float, float] | None:
    """Of the mean of independent values; None of one."""
    if len(values) < 2:
        return None
    half = (
        student_t.ppf((1 + CONFIDENCE) / 2, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
    )
    mean = float(np.mean(values))
    return mean - half, mean + half


def race(pairs: int, workers: int) -> dict[str, Any]:
    """The figures."""
    found = list(duels(pairs))
    matches = {duel.match.key: duel for duel in found}
    console = Console(stderr=True)
    results = run_matches([duel.match for duel in found], workers)
    raced = [
        (matches[match.key], result) for match, result in track(results, "Races", len(found), console=console)
    ]
    variants = [name for name in VARIANTS if any(duel.run.variant == name for duel, _ in raced)]
    bases = [run for run in runs(RUNS) if run.variant == BASE and ended(run)]
    return {
        "pairs": pairs,
        "updates": UPDATES,
        "base": {"seeds": len(bases)} | training_end(bases),
        "variants": {name: judge(name, raced) for name in variants},
    }


def draw(variants: dict[str, dict[str, Any]], path: Path) -> None:
    """Points against contacts at fault, with their intervals for each variant; the base at no points."""
    figure = Figure(figsize=(8.0, 4.6), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.grid(color="#e4e7ea", linewidth=0.6)
    axes.set_axisbelow(True)
    for name, of in variants.items():
        x, y = of["at_fault_per_km"], of["points"]
        x_ends = [of[f"at_fault_per_km_{end}"] for end in ("low", "high")]
        across = None if None in x_ends else [[x - x_ends[0]], [x_ends[1] - x]]
        up = [[y - of["points_low"]], [of["points_high"] - y]]
        bars = axes.errorbar(x, y, up, across, fmt="o", capsize=3, label=name)
        axes.plot([x] * of["seeds"], of["points_by_seed"], "_", color=bars[0].get_color(), alpha=0.6)
    mean = float(np.mean([of["base_at_fault_per_km"] for of in variants.values()]))
    axes.plot(mean, 0.0, "D", color=GREY, label="base, in the same races")
    axes.set_xlim(left=0.0)
    axes.set_xlabel("contacts at fault, 1/km and car")
    axes.set_ylabel("team points a race, less those of the base")
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    with whole_file(path) as partial:
        figure.savefig(partial, format="png", dpi=110)


def main() -> None:
    """Train, or race and print the figures as JSON."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.ablation", description="What parts of the method are worth"
    )
    parser.add_argument("what", nargs="?", choices=("train", "race"), default="race")
    parser.add_argument("--out", type=Path, default=Path("runs/ablation"), help="folder of the runs")
    parser.add_argument("--part", type=int, default=0, help="of the runs that this command trains")
    parser.add_argument("--parts", type=int, default=1)
    parser.add_argument("--pairs", type=int, default=48, help="mirrored pairs of races of each duel")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", type=Path, help="file for the figures as well")
    parser.add_argument("--figure", type=Path, help="PNG file to draw them to")
    chosen = parser.parse_args()
    if chosen.what == "train":
        train(chosen.out, chosen.part, chosen.parts)
        return
    figures = race(chosen.pairs, chosen.workers)
    if chosen.json:
        write_result(chosen.json, figures)
    if chosen.figure:
        draw(figures["variants"], chosen.figure)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()

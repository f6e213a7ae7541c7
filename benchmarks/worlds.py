"""Whether a selection in other worlds sends a better checkpoint than one would take without it.

Run as `python -m benchmarks.worlds DIR... [--config NAME=FILE] [--json FILE]` on folders that
`examples.worlds.train`, or an example that trains itself, has filled, called WORLD-SEED. Of each run it
compares the checkpoint that `nathlon.select` sends with the last one and, if returns.json is there, with the
one of the highest training return, in the last scenario of the world: against each other where that has two
sides, else each with the baseline on the same seeds. None of the seeds is one of the selection's. Prints one
JSON object: by world and run

- `checkpoints`: how many there are; `sent`: the training steps of the one that is sent;
- `episodes`: fresh ones of each comparison;
- `last`, `best_return` (None without returns.json): `steps` of the other; `scores`, the means of the one
  sent and of the other; `difference` of the means with its interval `low`, `high`; `verdict`: win, tie or
  loss, as far as that interval leaves out 0, or same.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats

import nathlon
from benchmarks.result import write_result
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import TESTED, Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.world_registry import load_world
from nathlon.policies.sources.finding import find_sources
from nathlon.selection.trials import against, draw_seeds

FRESH = np.random.SeedSequence(2029)
CONFIDENCE = 0.95


def compare(one: Entrant, other: Entrant, episodes: int, pool: Pool) -> dict[str, Any]:
    """How the mean scores of two entrants differ on fresh seeds."""
    if one.id == other.id:
        return {"steps": _steps(other), "verdict": "same"}
    world = load_world(one.world)
    scenario = world.scenarios[-1]
    setup, seeds = world.setup(scenario), draw_seeds(FRESH, episodes)
    if len(setup.sides) == 2 and all(len(side) == 1 for side in setup.sides):
        scores = _met(one, other, scenario, seeds, pool)
    else:
        scores = np.stack([_alone(entrant, scenario, seeds, pool) for entrant in (one, other)])
    differences = scores[0] - scores[1]
    mean, spread = float(differences.mean()), float(stats.sem(differences))
    reach = spread * float(stats.t.ppf((1 + CONFIDENCE) / 2, episodes - 1))
    verdict = "win" if mean - reach > 0 else "loss" if mean + reach < 0 else "tie"
    return {
        "steps": _steps(other),
        "scores": [round(float(mean), 3) for mean in scores.mean(axis=1)],
        "difference": round(mean, 3),
        "low": round(mean - reach, 3),
        "high": round(mean + reach, 3),
        "verdict": verdict,
    }


def _met(
    one: Entrant, other: Entrant, scenario: str, seeds: Sequence[int], pool: Pool
) -> NDArray[np.float64]:
    """Mean scores (2, seeds) of both entrants, who take each side once on each seed."""
    races = [Race(seed, (Seat(side), Seat(1 - side)), bool(side)) for seed in seeds for side in (0, 1)]
    ids, sources = (one.id, other.id), (one.source, other.source)
    rows = _played(Match("race", "fresh", scenario, "", "", ids, sources, tuple(races), one.world), pool)
    own = [rows.filter(pl.col("entrant") == entrant).sort("race")["score"].to_numpy() for entrant in ids]
    return np.stack(own).reshape(2, len(seeds), 2).mean(axis=2)


def _alone(entrant: Entrant, scenario: str, seeds: Sequence[int], pool: Pool) -> NDArray[np.float64]:
    """Scores (seeds,) of an entrant on the sides in turn, the others being the baseline's."""
    world = load_world(entrant.world)
    sides = len(world.setup(scenario).sides)
    slots = range(1, sides + 1)
    match = against("race", "fresh", scenario, entrant, (world.baseline,) if sides > 1 else (), slots, seeds)
    rows = _played(match, pool).filter(pl.col("team") == TESTED)
    return rows.group_by("race").agg(pl.col("score").mean()).sort("race")["score"].to_numpy()


def _played(match: Match, pool: Pool) -> pl.DataFrame:
    ((_, rows),) = list(pool.run([match]))
    return rows


def _steps(entrant: Entrant) -> int:
    """Of training, which the file's name ends with."""
    return int(entrant.name.rpartition("_")[2])


def _name(world: str) -> str:
    """By which an example world is loaded."""
    return f"examples/worlds/{world}.py:world"


def _packages(world: str) -> dict[str, str]:
    """Versions of the packages that a world names, in its own interpreter where it has one."""
    [*_, scenario] = load_world(_name(world)).scenarios
    told = load_world(_name(world)).facts(scenario)["world_files"]["packages"]
    return {name: number for name, number in told.items() if name not in ("numpy", "python")}


def judge(folder: Path, config: Path | None, episodes: int, workers: int) -> dict[str, Any]:
    """Select among the checkpoints of a training run, and compare the one that is sent."""
    name = _name(folder.name.partition("-")[0])
    out = folder.with_name(f"{folder.name}-selected")
    sent = nathlon.select(folder, out, config=config, world=name, workers=workers, progress=False).sent
    world = load_world(name)
    entrants = [world.enter(source) for source in find_sources([folder], endings=world.loaders)]
    chosen = next(entrant for entrant in entrants if entrant.name == sent[0])
    told = folder / "returns.json"
    returns: Mapping[str, float] = json.loads(told.read_text("utf-8")) if told.exists() else {}
    best = max(entrants, key=lambda entrant: returns[entrant.name]) if returns else None
    with Pool(workers) as pool:
        return {
            "checkpoints": len(entrants),
            "sent": _steps(chosen),
            "episodes": episodes,
            "last": compare(chosen, entrants[-1], episodes, pool),
            "best_return": None if best is None else compare(chosen, best, episodes, pool),
        }


def main() -> None:
    """Judge some training runs."""
    parser = argparse.ArgumentParser(prog="benchmarks.worlds", description="Selection in other worlds")
    parser.add_argument("folders", nargs="+", type=Path, help="of training runs, called WORLD-SEED")
    parser.add_argument("--config", action="append", default=[], help="WORLD=FILE: how to select there")
    parser.add_argument("--episodes", action="append", default=[], help="WORLD=NUMBER of fresh ones, 200")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write a result for the page of figures")
    given = parser.parse_args()
    configs = {world: Path(file) for world, file in (text.split("=") for text in given.config)}
    counts = {world: int(number) for world, number in (text.split("=") for text in given.episodes)}
    figures: dict[str, dict[str, Any]] = {}
    packages: dict[str, str] = {"stable-baselines3": version("stable-baselines3")}
    for folder in given.folders:
        world, _, seed = folder.name.partition("-")
        judged = judge(folder, configs.get(world), counts.get(world, 200), given.workers)
        figures.setdefault(world, {})[seed] = judged
        packages |= _packages(world)
        print(json.dumps({folder.name: judged}), flush=True)
    if given.json:
        write_result(given.json, figures, packages)


if __name__ == "__main__":
    main()

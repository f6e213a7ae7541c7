"""What a reward is worth that nobody made by hand: the embedded loop beside the one that somebody did.

`python -m benchmarks.reward_design --json FILE [--rounds N] [--kept N] [--updates N] [--final N]` lets the
embedded proposer and the rule design a reward on the Lindenring, and trains the reward of `design.toml` for
as many updates as the winner's last training, from the same seed. Both then drive time trials, and clips from
starts that the design has not had. The runs lie in a folder beside the JSON; the same command goes on after
Ctrl-C.

Figures: `settings`; `rounds`, of each the candidates with `formula`, `tac`, `refused`, and of those trained
`strength`, `marks` of the rule and `lap_s`; `formula` of the winner; for `designed` and `by_hand`: `lap_s`,
the median of eight time trials (null unless half of them were completed), `clean` of them without leaving the
course, `marks`, and the means of `nathlon.lab.reward.measures.MEASURES` of a clip; `points`, by how many
team points a race the designed one beats the other, 4v4, and its interval; and `processor_s` of all of it in
this process, over all its starts.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch

from benchmarks.result import write_result
from benchmarks.time_trial import drive_alone
from nathlon.arena.entrant import enter
from nathlon.arena.pool import run_matches
from nathlon.lab.reward.clips import Studio
from nathlon.lab.reward.design import FINAL, Design
from nathlon.lab.reward.judging import JudgingRule
from nathlon.lab.reward.library import DRIVER
from nathlon.lab.reward.measures import marks, mean, measure, read_rule
from nathlon.lab.reward.sampling import Sampler
from nathlon.lab.reward.settings import DesignSettings
from nathlon.lab.reward.trying import train
from nathlon.policies.load import load_policy
from nathlon.policies.training.config import CONFIGS, read_config
from nathlon.policies.training.log import Status
from nathlon.selection.round_robin import tournament_matches
from nathlon.sim.whole_file import whole_file
from nathlon.terminal import say
from nathlon.tournament.points import matchups

TASK = "drive fast, leave room, stay on the road"
FRESH_SEED, FRESH_STARTS = 90_000, 48
PAIRS = 20
"""Mirrored pairs of races between the two."""
BY_HAND = "by-hand"


class Clock:
    """Processor time of this work, also of what earlier processes did; kept in a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._before = float(path.read_text("utf-8")) if path.exists() else 0.0

    def note(self) -> float:
        """Keep the time so far, s."""
        now = self._before + time.process_time()
        with whole_file(self._path) as partial:
            partial.write_text(f"{now:.1f}\n", "utf-8")
        return now


def driven(checkpoint: Path, settings: DesignSettings) -> dict[str, Any]:
    """How a checkpoint drives alone, and among others from fresh starts."""
    circuit, car = settings.training.circuit, settings.training.car
    studio = Studio(circuit, car, FRESH_STARTS, FRESH_SEED)
    driver, _ = studio.film(load_policy(DRIVER, circuit, car), DRIVER)
    clips, _ = studio.film(load_policy(str(checkpoint), circuit, car), checkpoint.stem)
    measured = measure(clips, driver, studio.step_s)
    rule = read_rule(settings.rule)
    alone = drive_alone(enter(str(checkpoint), circuit, car))
    return {
        "lap_s": round(alone.lap_s, 3) if math.isfinite(alone.lap_s) else None,
        "clean": alone.clean,
        "marks": round(sum(marks(rule, one) for one in measured) / len(measured), 3),
        **{name: round(value, 4) for name, value in mean(measured).items()},
    }


def points(designed: Path, by_hand: Path, settings: DesignSettings) -> list[float]:
    """Team points a race by which the designed one beats the other, and the 95 % interval's bounds."""
    place = settings.training.circuit, settings.training.car
    entrants = [enter(str(path), *place) for path in (designed, by_hand)]
    matches = tournament_matches(entrants, PAIRS, np.random.SeedSequence(FRESH_SEED))
    results = pl.concat([rows for _, rows in run_matches(matches, 1)])
    table = matchups(results, np.random.default_rng(FRESH_SEED))
    row = table.row(by_predicate=pl.col("entrant") == entrants[0].id, named=True)
    return [round(row[name], 2) for name in ("difference", "difference_low", "difference_high")]


def told(design: Design) -> list[list[dict[str, Any]]]:
    """Candidates of each round."""
    rule = read_rule(design.settings.rule)
    rounds = []
    for candidates, outcomes in zip(design.rounds, design.outcomes, strict=True):
        came = {one.candidate.name: one for one in outcomes}
        rows = []
        for one in candidates:
            row: dict[str, Any] = {"name": one.name, "formula": one.formula, "refused": one.refused}
            if one.alignment:
                row["tac"] = round(one.alignment.tac, 3)
            if outcome := came.get(one.name):
                row["strength"], row["lap_s"] = round(outcome.strength, 2), outcome.lap_s
                row["marks"] = round(marks(rule, outcome.measured), 3)
            rows.append(row)
        rounds.append(rows)
    return rounds


def main() -> None:
    """Design, train by hand, compare."""
    parser = argparse.ArgumentParser(prog="benchmarks.reward_design", description="Rewards without hands")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--kept", type=int, default=3)
    parser.add_argument("--updates", type=int, default=5000, help="of a candidate")
    parser.add_argument(
        "--final", type=int, default=15000, help="of the winner, and of the reward made by hand"
    )
    asked = parser.parse_args()
    torch.set_num_threads(1)
    training = read_config(CONFIGS / "design.toml")
    settings = DesignSettings(
        task=TASK,
        training=training,
        rounds=asked.rounds,
        kept=asked.kept,
        updates=asked.updates,
        final_updates=asked.final,
    )
    folder = asked.json.with_suffix("")
    design = Design(folder, settings)
    clock = Clock(folder / "processor_s")
    by_hand = settings.run("progress / m", asked.final).model_copy(update={"reward": training.reward})

    def tell(done: int, what: str) -> None:
        clock.note()
        say(f"{done:>7} {what}")

    def on_status(status: Status) -> None:
        tell(status.updates, f"by hand, lap {status.lap_s:.1f} s")

    design.run(Sampler(settings.seed), JudgingRule(settings.rule, design.studio.step_s), tell, lambda: None)
    train(folder / BY_HAND, by_hand, settings.seed, on_status)
    assert design.final is not None, "it has come to its end"
    figures = {
        "settings": settings.model_dump(exclude={"training"}),
        "rounds": told(design),
        "formula": design.final.candidate.formula,
        "factor": design.final.candidate.factor,
        "fresh_starts": FRESH_STARTS,
    }
    last = {
        name: max((folder / place / "checkpoints").glob("*.safetensors"))
        for name, place in (("designed", FINAL), ("by_hand", BY_HAND))
    }
    for name, checkpoint in last.items():
        figures[name] = driven(checkpoint, settings)
    figures["points"] = points(last["designed"], last["by_hand"], settings)
    figures["processor_s"] = round(clock.note())
    write_result(asked.json, figures)


if __name__ == "__main__":
    main()

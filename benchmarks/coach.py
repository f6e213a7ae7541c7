"""What the coach finds in the laps of bundled checkpoints, and what its findings are worth in training.

`python -m benchmarks.coach laps --json FILE` has every fifth checkpoint of each ladder drive a time trial and
coaches it against the champion of its circuit. The JSON has, by circuit, a row for each checkpoint: `lap_s`,
`other_s`, `lost_s`; of the `bends` how many were `advised`, and in how many nothing could be proved
(`unproved`); edits `tried`; the gains `summed_s`, and of all advice `together_s` (null if there is none, or
it could not be driven); `kinds` of the advice with their numbers; and `wall_s` of the coach's work.

`python -m benchmarks.coach training --json FILE [--seeds N] [--base N] [--updates N]` trains a time trial
from scratch, coaches the lap of its last checkpoint, and goes on from there with each seed twice: with
mistakes alone, and with the coach's starts besides. The JSON has the `updates` of the `base` and `after` it,
the sections before which the coach's `starts` are and what was lost there, s; and of the `base` and, by
seed, of `mistakes` and `coached` the median `lap_s` of eight time trials (null where half of the starts gave
none), the `best_s`, and the `off_course_share` of the time. The runs lie in a folder beside the JSON; the
same command goes on after Ctrl-C.

`python -m benchmarks.coach faults --json FILE` plants known faults in the built-in driver
(`benchmarks.planted_faults`) on the champions' circuits, and coaches it against itself without the fault. The
JSON has, by circuit and fault, how many `sections` lost 0.05 s by it, in how many the first cause `named` it,
and what was said in the others (`instead`); and over all the share `named`, its 95 % interval (Wilson) from
`low` to `high`, and the `goal`. It fails where the share is below the goal.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

import nathlon
from benchmarks.ladders import ladder
from benchmarks.planted_faults import FAULTS, PACE, Fault, driven, planted
from benchmarks.result import write_result
from benchmarks.time_trial import drive_alone
from nathlon.arena.entrant import enter
from nathlon.arena.race_log import RaceLog
from nathlon.lab.coach.coach import Coach
from nathlon.lab.coach.lap import Lap
from nathlon.lab.coach.lap import laps_of as laps_driven
from nathlon.lab.coach.parts import CoursePart, parts_of
from nathlon.lab.coach.reference import Reference
from nathlon.lab.drive.finalists import champions
from nathlon.policies.driver import Driver
from nathlon.policies.training.coached import read_coach
from nathlon.policies.training.config import CONFIGS, TrainingConfig, read_config
from nathlon.policies.training.run_folder import CONFIG_FILE
from nathlon.policies.training.trainer import Trainer
from nathlon.sim.errors import InputError
from nathlon.terminal import say
from nathlon.terminal.progress import progress_bars

GOAL = 0.9
"""Share of planted faults that are to be the first cause."""
LOST_S = 0.05
"""A section in which a fault costs less is not looked at."""
EVERY = 5
"""Of each ladder's checkpoints, in the order of their names."""


def coach_lap(checkpoint: str, circuit: str, car: str, folder: Path) -> nathlon.CoachResult:
    """Coach a checkpoint's time trial.

    Raises:
        InputError: if it completes no lap.
    """
    result = nathlon.race([checkpoint], scenario="time_trial", circuit=circuit, car=car, record=folder)
    assert result.recording is not None, "it was asked for"
    return nathlon.coach(result.recording, car=0, out=folder / "coach", progress=False)


def laps(folder: Path) -> dict[str, list[dict[str, Any]]]:
    """What the coach finds in the ladders' laps."""
    found: dict[str, list[dict[str, Any]]] = {}
    for champion in champions():
        circuit, car = champion.circuit, champion.car
        assert circuit is not None
        assert car is not None
        rows = found[circuit] = []
        for path in ladder(circuit)[::EVERY]:
            began = time.monotonic()
            try:
                facts = coach_lap(str(path), circuit, car, folder / path.stem).facts
            except InputError as error:
                say(f"{path.stem}: {error}")
                continue
            rows.append(
                {
                    "checkpoint": path.stem,
                    "lap_s": facts.lap.lap_s,
                    "other_s": facts.other_lap_s,
                    "lost_s": facts.lost_s,
                    "bends": len(facts.attempts),
                    "advised": len(facts.advice),
                    "unproved": sum(bool(one.unproved) for one in facts.attempts),
                    "tried": sum(one.tried for one in facts.attempts),
                    "summed_s": round(sum(one.gain_s for one in facts.advice), 3),
                    "together_s": facts.together_s,
                    "kinds": dict(Counter(one.kind for one in facts.advice)),
                    "wall_s": round(time.monotonic() - began, 1),
                }
            )
            say(f"{path.stem}: {rows[-1]}")
    return found


def trained(folder: Path, config: TrainingConfig, seed: int, origin: Path | None = None) -> Path:
    """The last checkpoint of a training run, which goes on in its folder if it is there already."""
    begun = (folder / CONFIG_FILE).exists()
    trainer = Trainer.resume(folder) if begun else Trainer.start(folder, config, seed, origin)
    with progress_bars() as progress:
        task = progress.add_task(f"{folder.name} {seed}", total=config.updates, note="warming up")
        trainer.run(
            lambda status: progress.update(
                task, completed=status.updates, note=f"{status.updates_per_s:.0f}/s"
            )
        )
    return max((folder / "checkpoints").glob("*.safetensors"))


def laps_of(checkpoint: Path, config: TrainingConfig) -> dict[str, float | None]:
    """How a checkpoint does in time trials."""
    found = drive_alone(enter(str(checkpoint), config.circuit, config.car))
    told = {"lap_s": found.lap_s, "best_s": found.best_s, "off_course_share": found.off_course_share}
    return {name: round(value, 4) if math.isfinite(value) else None for name, value in told.items()}


def training(folder: Path, seeds: int, base: int, updates: int) -> dict[str, Any]:
    """Laps after training with mistakes alone, and with the coach's starts besides."""
    config = read_config(CONFIGS / "time_trial.toml")
    begun = config.model_copy(update={"updates": base, "checkpoint_every": base})
    first = trained(folder / "base", begun, 0)
    result = coach_lap(str(first), config.circuit, config.car, folder / "lap")
    starts = read_coach(result.facts_file, config.circuit, config.car)
    further = config.model_copy(update={"updates": updates, "checkpoint_every": updates})
    arms = {"mistakes": further, "coached": further.model_copy(update={"coached": starts})}
    found: dict[str, Any] = {
        "updates": {"base": base, "after": updates},
        "starts": {start.section: start.lost_s for start in starts},
        "base": laps_of(first, config),
        "seeds": {},
    }
    for seed in range(1, seeds + 1):
        found["seeds"][seed] = {
            arm: laps_of(trained(folder / f"{arm}-{seed}", settings, seed, folder / "base"), config)
            for arm, settings in arms.items()
        }
        say(f"seed {seed}: {found['seeds'][seed]}")
    return found


def faults() -> dict[str, Any]:
    """How often the coach's first cause is the fault that was planted."""
    rows: list[dict[str, Any]] = []
    for champion in champions():
        circuit, car = champion.circuit, champion.car
        assert circuit is not None
        assert car is not None
        log = driven(Driver(circuit, car, PACE), circuit, car)
        clean = laps_driven(log, 0)[0]
        parts = parts_of(log.sections, (clean, clean))
        for fault in FAULTS:
            policy, where = planted(fault, circuit, car, parts, clean)
            row = {
                "circuit": circuit,
                "fault": fault.name,
                **_named(driven(policy, circuit, car), fault, where, clean),
            }
            say(f"{circuit}, {fault.name}: {row}")
            rows.append(row)
    sections, named = (sum(row[name] for row in rows) for name in ("sections", "named"))
    interval = binomtest(named, sections).proportion_ci(0.95, "wilson")
    return {
        "rows": rows,
        "sections": sections,
        "named": round(named / sections, 3),
        "low": round(interval.low, 3),
        "high": round(interval.high, 3),
        "goal": GOAL,
    }


def _named(log: RaceLog, fault: Fault, where: Sequence[CoursePart], clean: Lap) -> dict[str, Any]:
    """In how many of the sections with a fault the first cause names it."""
    try:
        coach = Coach(log, 0, Reference("the driver", "driver", clean, None))
    except InputError:
        return {"sections": 0, "named": 0, "instead": {"no lap": 1}}
    spoilt = {part.number for part in where}
    first = [
        section.causes[0].kind if section.causes else "nothing"
        for number, section in enumerate(coach.sections())
        if number in spoilt and section.lost_s >= LOST_S
    ]
    named = sum(kind in fault.kinds for kind in first)
    return {
        "sections": len(first),
        "named": named,
        "instead": dict(Counter(kind for kind in first if kind not in fault.kinds)),
    }


def main() -> None:
    """Run one of the three."""
    parser = argparse.ArgumentParser(prog="benchmarks.coach", description="The coach")
    parser.add_argument("what", choices=("laps", "training", "faults"))
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--base", type=int, default=16_000, help="updates before the coach looks")
    parser.add_argument("--updates", type=int, default=6_000, help="updates after it has")
    asked = parser.parse_args()
    folder = asked.json.with_suffix("")
    if asked.what == "laps":
        write_result(asked.json, laps(folder))
    elif asked.what == "faults":
        found = faults()
        write_result(asked.json, found)
        if found["named"] < GOAL:
            raise SystemExit(f"{found['named']:.1%} of planted faults are named first, expected {GOAL:.0%}")
    else:
        write_result(asked.json, training(folder, asked.seeds, asked.base, asked.updates))


if __name__ == "__main__":
    main()

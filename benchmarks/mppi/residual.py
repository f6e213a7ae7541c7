"""The same aim trained for: a policy goes on learning with the objective added to its own reward.

This is the simplest Residual-SAC: QR-SAC from the networks of a finished run, at a small rate, with the
reward of that run itself in the place of the policy's log-probability.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.mppi.driven import SETTINGS, laps, planned
from nathlon.policies.training.config import CONFIGS, TrainingConfig, read_config
from nathlon.policies.training.run_folder import CONFIG_FILE
from nathlon.policies.training.trainer import Trainer
from nathlon.terminal import say
from nathlon.terminal.progress import progress_bars

SETTING = SETTINGS["kerbs and edges avoided"]
SHARE = 0.1
"""Of the objective in the reward. To QR-SAC 0.01 of reward, its alpha, is a factor of e in probability; the
planner weighs its objective against a tenth of the log-probability."""
RATE, ALPHA = 1e-4, 0.003
"""Of the policy, a fifth of that from scratch; the entropy's weight with which the run has ended."""
RACES, WARM_UP = 32, 5_000
EVERY = 500
MEASURED = (1, 2, 4, 8)
"""Checkpoints, one every so many updates."""


def configuration(updates: int) -> TrainingConfig:
    """Of the further training."""
    config = read_config(CONFIGS / "time_trial.toml")
    alone = config.rollouts[0].model_copy(update={"races": RACES, "share": None})
    rates = {"policy_rate": RATE, "final_rates": 1.0, "alpha": ALPHA, "final_alpha": 1.0}
    return config.model_copy(
        update={
            "updates": updates,
            "warm_up": WARM_UP,
            "checkpoint_every": EVERY,
            "rollouts": (alone,),
            "qrsac": config.qrsac.model_copy(update=rates),
            "reward": config.reward.model_copy(update={"expression": f"{SHARE} * ({SETTING.objective})"}),
        }
    )


def residual(run: Path, folder: Path) -> dict[str, Any]:
    """Laps of a run's last checkpoint, of the planner around it, and of what is trained from it.

    Args:
        run: of a time trial, as by `nathlon train time_trial`.
        folder: for the further training, which goes on there.
    """
    origin = max((run / "checkpoints").glob("*.safetensors"))
    found: dict[str, Any] = {
        "objective": SETTING.objective,
        "bare": laps(str(origin), SETTING),
        "planned": laps(planned(SETTING.objective, origin), SETTING),
        "trained": [],
    }
    config = configuration(MEASURED[-1] * EVERY)
    begun = (folder / CONFIG_FILE).exists()
    trainer = Trainer.resume(folder) if begun else Trainer.start(folder, config, 1, run)
    with progress_bars() as progress:
        task = progress.add_task("training", total=config.updates, note="warming up")
        trainer.run(lambda status: progress.update(task, completed=status.updates, note=""))
    for number in MEASURED:
        updates = number * EVERY
        lap = laps(str(folder / "checkpoints" / f"step-{updates:07d}.safetensors"), SETTING)
        driven_s = 0.1 * (WARM_UP + RACES * updates / config.updates_per_step)
        found["trained"].append({"updates": updates, "hours": round(driven_s / 3600.0, 2), **lap})
        say(str(found["trained"][-1]))
    lap_s = found["bare"]["lap_s"]
    for row in found["trained"]:
        row["laps"] = round(row["hours"] * 3600.0 / lap_s)
    return found

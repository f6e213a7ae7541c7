"""Ablations: what a part of the method is worth, by training without it.

A variant makes a configuration from the base; each run of one, with one seed, is an ordinary training run.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.log import CURVE_FILE, Status
from nathlon.policies.training.run_folder import (
    CONFIG_FILE,
    make_run_folder,
    newest_checkpoint,
    read_run_folder,
)
from nathlon.policies.training.state import STATE_FILE, load_state
from nathlon.policies.training.trainer import Diverged, Trainer
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.validation import read_json
from nathlon.sim.whole_file import write_whole

Variant = Callable[[TrainingConfig], TrainingConfig]

BASE = "base"
BASE_FILE = "ablation.json"
BASE_SCENARIO = re.compile("1v[0-7]")
"""Scenarios of racing as such; all others teach a skill."""


def no_quantiles(config: TrainingConfig) -> TrainingConfig:
    """Plain SAC: the critics estimate the mean return, not its quantiles."""
    return config.model_copy(update={"qrsac": config.qrsac.model_copy(update={"distributional": False})})


def float32(config: TrainingConfig) -> TrainingConfig:
    """All matrix products in float32, also where the processor has instructions for bfloat16."""
    return config.model_copy(update={"qrsac": config.qrsac.model_copy(update={"precision": "float32"})})


def n_step(steps: int) -> Variant:
    """Transitions of so many steps."""

    def variant(config: TrainingConfig) -> TrainingConfig:
        return config.model_copy(update={"qrsac": config.qrsac.model_copy(update={"n_step": steps})})

    return variant


def one_table(config: TrainingConfig) -> TrainingConfig:
    """One replay table for all rollouts; a single rollout has one in any case."""
    return config.model_copy(update={"tables": "one"}) if len(config.rollouts) > 1 else config


def no_passing_reward(config: TrainingConfig) -> TrainingConfig:
    """No reward for ground gained on opponents."""
    return config.model_copy(update={"reward": config.reward.model_copy(update={"passing": 0.0})})


def no_skill_scenarios(config: TrainingConfig) -> TrainingConfig:
    """Only rollouts of the base scenarios, 1v0 to 1v7; shares of the minibatch keep their proportions.

    Raises:
        InputError: if there is none.
    """
    kept = tuple(rollouts for rollouts in config.rollouts if BASE_SCENARIO.fullmatch(rollouts.scenario))
    if not kept:
        raise InputError("no-skill-scenarios: no rollouts are left, expected some of 1v0 to 1v7")
    if len(kept) == len(config.rollouts):
        return config
    if whole := sum(rollouts.share or 0.0 for rollouts in kept):
        kept = tuple(
            rollouts.model_copy(update={"share": (rollouts.share or 0.0) / whole}) for rollouts in kept
        )
    return config.model_copy(update={"rollouts": kept})


def no_course_points(config: TrainingConfig) -> TrainingConfig:
    """Policies that do not see the course ahead."""
    blind = config.observation.model_copy(update={"course_points": 0})
    return config.model_copy(update={"observation": blind})


VARIANTS: dict[str, Variant] = {
    "no-quantiles": no_quantiles,
    "n-step-1": n_step(1),
    "n-step-3": n_step(3),
    "n-step-5": n_step(5),
    "n-step-7": n_step(7),
    "one-table": one_table,
    "no-passing-reward": no_passing_reward,
    "no-skill-scenarios": no_skill_scenarios,
    "no-course-points": no_course_points,
    "float32": float32,
}
"""By name, in the order of the figure."""


def configurations(base: TrainingConfig, names: Iterable[str]) -> dict[str, TrainingConfig]:
    """The base and the named variants that differ from it, by name.

    Raises:
        InputError: if a variant is unknown or cannot be made.
    """
    configs = {BASE: base}
    for name in names:
        if name not in VARIANTS:
            raise InputError(f"variant {name!r} is unknown; expected one of {', '.join(VARIANTS)}")
        config = VARIANTS[name](base)
        if config != base:
            configs[name] = config
    return configs


@dataclass(frozen=True)
class AblationRun:
    """One training run of an ablation."""

    variant: str
    seed: int
    folder: Path
    config: TrainingConfig

    def __str__(self) -> str:
        return f"{self.variant}, seed {self.seed}"

    @property
    def updates(self) -> int:
        """How many it has behind it."""
        return load_state(self.folder).updates if (self.folder / STATE_FILE).exists() else 0

    @property
    def finished(self) -> bool:
        """Whether it has come to its end."""
        return self.updates >= self.config.updates

    @property
    def curve(self) -> Path:
        """The curve of its checkpoints; may be missing."""
        return self.folder / CURVE_FILE

    @property
    def last_checkpoint(self) -> Path | None:
        """The last checkpoint so far."""
        return newest_checkpoint(self.folder)

    def claim(self) -> None:
        """Make its folder that of this run; it may be so already.

        Raises:
            InputError: if its folder cannot be used or holds another run.
        """
        if not (self.folder / CONFIG_FILE).exists():
            make_run_folder(self.folder, self.config, self.seed)
        elif read_run_folder(self.folder) != (self.config, self.seed):
            raise InputError(f"{self.folder}: holds another training run; choose another folder")

    def trainer(self) -> Trainer:
        """The run, at its beginning or where it stopped.

        Raises:
            InputError: if its folder cannot be used or holds another run.
        """
        self.claim()
        return Trainer.resume(self.folder)


OnStatus = Callable[[AblationRun, Status], None]
"""Told every few hundred updates how a run is getting on."""
Train = Callable[[Iterable[AblationRun], OnStatus], Iterator[str]]
"""Trains runs to their end, and yields for each that has come to it why it diverged, or ''."""


def plan(configs: dict[str, TrainingConfig], seeds: int, out: Path) -> list[AblationRun]:
    """Every configuration with each seed from 1 on; first all with the first, to compare them early."""
    return [
        AblationRun(name, seed, out / name / f"seed-{seed}", config)
        for seed in range(1, seeds + 1)
        for name, config in configs.items()
    ]


def claim(out: Path, base: TrainingConfig) -> None:
    """Make a folder that of the ablations of a configuration; it may be so already.

    Raises:
        InputError: if it is that of another configuration, or cannot be read or written.
    """
    path = out / BASE_FILE
    try:
        if path.exists():
            _compare(path, read_json(read_text(path), TrainingConfig, path), base)
        else:
            out.mkdir(parents=True, exist_ok=True)
            write_whole(path, base.model_dump_json(indent=1))
    except OSError as error:
        raise InputError(f"{path}: cannot be read or written: {error.strerror}") from None


def _compare(path: Path, found: TrainingConfig, wanted: TrainingConfig) -> None:
    for name in TrainingConfig.model_fields:
        if getattr(found, name) != getattr(wanted, name):
            raise InputError(
                f"{path}: of another configuration, which differs in {name}; choose another folder"
            )


def train_in_turn(runs: Iterable[AblationRun], on_status: OnStatus) -> Iterator[str]:
    """Train runs here, one after the other; see `Train`."""
    for run in runs:
        try:
            run.trainer().run(partial(on_status, run))
        except Diverged as error:
            yield str(error)
        else:
            yield ""

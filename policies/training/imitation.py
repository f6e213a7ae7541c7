"""Imitation: a policy learns to drive from a teacher alone, without rewards.

In each round it drives many pairs of circuit and car under instruction
(`nathlon.policies.training.instruction`), then learns what was said there and in the rounds before.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from nathlon.policies.apart import load_guest
from nathlon.policies.checkpoint import Card, open_checkpoint, save_checkpoint
from nathlon.policies.training.config import ImitationSettings, Rollouts, TrainingConfig
from nathlon.policies.training.evaluation import LapEvaluation, evaluate_laps, mean_laps
from nathlon.policies.training.instruction import Class, School
from nathlon.policies.training.log import Status
from nathlon.policies.training.pairs import CHAMPION, Pair, PairDraw, ready_pairs
from nathlon.policies.training.polish_state import PolishState, load_state, save_state, write_curve
from nathlon.policies.training.pupil import NumbersPupil, Pupil, Rows, fresh
from nathlon.policies.training.rollout import scenario_of, tells_pace
from nathlon.policies.training.run_folder import (
    CHECKPOINTS,
    make_run_folder,
    read_policy,
    read_run_folder,
)
from nathlon.policies.training.seeing_pupil import SeeingPupil
from nathlon.policies.training.state import STATE_FILE, read_tensors, write_tensors
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import writing

CURVE = ("rounds", "updates", "transitions", "loss", "lap_s", "off_course_share")
ROWS = "rows"
"""Folder of a run in which what was noted in its rounds is kept, as long as it is learnt from."""


class Imitation:
    """A run of imitation in a folder of its own.

    Attributes:
        folder, config, seed: as given.
        updates, transitions: done so far.
    """

    def __init__(self, folder: Path, config: TrainingConfig, seed: int, origin: Path | None = None) -> None:
        """A run at its beginning, maybe with the policy of a checkpoint; nothing is written yet."""
        assert config.imitation is not None, "it imitates"
        self.folder, self.config, self.seed = folder, config, seed
        self._settings: ImitationSettings = config.imitation
        self._card = Card(
            format=2 if config.vision else 1,
            algorithm="DAgger",
            hidden=config.qrsac.hidden,
            encoder=config.qrsac.encoder,
            practises=config.practises,
            vision=config.vision,
            observation=config.observation.spec(),
            circuit=config.circuit,
            car=config.car,
            scenarios=tuple(dict.fromkeys(rollouts.scenario for rollouts in config.rollouts)),
            step=0,
            transitions=0,
            seed=seed,
            created_by={"nathlon": version("nathlon"), "torch": version("torch")},
        )
        if origin is None:
            first = fresh(self._card, np.random.default_rng(seed))
        else:
            first = read_policy(origin, self._card.shapes)
        self._pupil = self._new_pupil(first)
        self.updates = self.transitions = self._rounds = 0
        self._weights: NDArray[np.float64] | None = None
        self._curve = np.zeros((0, len(CURVE)))
        self._facts = {
            "configuration": config.model_dump_json(exclude={"workers"}),
            "seed": str(seed),
        }

    def _new_pupil(self, tensors: dict[str, NDArray[np.float32]]) -> Pupil:
        config, batch = self.config, self.config.qrsac.batch
        if config.vision is None:
            return NumbersPupil(self._card, batch, self._settings.mirrored, tensors)
        pair = Pair(config.circuit, config.car)
        teacher = load_guest(pair.wise(self._settings.teacher), *pair[:2])
        return SeeingPupil(self._card, self._settings, batch, teacher.observation_spec, tensors)

    @classmethod
    def start(cls, folder: Path, config: TrainingConfig, seed: int, origin: Path | None = None) -> Imitation:
        """Begin a run in a new folder.

        Args:
            folder: of the run.
            config: what it is made of.
            seed: of all randomness.
            origin: folder of another run of imitation, whose pupil goes on, or a checkpoint, whose policy
                does.

        Raises:
            InputError: if the folder already holds a run or cannot be made, or the other run has no state or
                another network.
        """
        checkpoint = origin if origin is not None and origin.is_file() else None
        run = cls(folder, config, seed, checkpoint)
        if origin is not None and checkpoint is None:
            state = load_state(origin, {}) if (origin / STATE_FILE).exists() else None
            if state is None:
                raise InputError(f"{origin}: no run of imitation to start from, nor a checkpoint")
            run._take(origin, state)
        make_run_folder(folder, config, seed)
        if origin is not None:
            run._keep(np.zeros(0))
        return run

    @classmethod
    def resume(cls, folder: Path) -> Imitation:
        """Go on with the run in a folder.

        Raises:
            InputError: if it holds no run, or one that cannot be read.
        """
        run = cls(folder, *read_run_folder(folder))
        state = load_state(folder, run._facts)
        if state:
            run._take(folder, state)
            run._rounds, run.updates, run.transitions = state.rounds, state.updates, state.transitions
            run._weights, run._curve = state.weights if state.rounds else None, state.curve
        return run

    def _take(self, folder: Path, state: PolishState) -> None:
        """Go on with the tensors of a run in a folder."""
        try:
            self._pupil.trained.load(state.learner)
        except ValueError as error:
            raise InputError(f"{folder}: of another run: {error}") from None

    def run(
        self, on_status: Callable[[Status], None], on_pair: Callable[[int, int], None] = lambda *_: None
    ) -> None:
        """All rounds to the end, or until KeyboardInterrupt; the rounds that are done are kept either way.

        Args:
            on_status: told of each round that is done.
            on_pair: told how many pairs of a variety are ready, and of how many.

        Raises:
            InputError: if the races cannot be made or a file cannot be written.
        """
        pairs, self._evaluated = ready_pairs(self.folder, self.config, on_pair)
        self.hold(pairs)
        school = School(self.config)
        try:
            while self._rounds < self._settings.rounds:
                on_status(self._round(school))
        finally:
            school.close()

    def hold(self, pairs: Sequence[Pair]) -> None:
        """Hold the races of all rounds to come on some pairs.

        Raises:
            InputError: if champions are to race, and none comes with nathlon for any of them.
        """
        self._draw = PairDraw(pairs, self._weights)
        self._home = [pair for pair in pairs if pair.has_champion]
        for rollouts in self.config.rollouts:
            if rollouts.racer == CHAMPION and not self._home:
                raise InputError(
                    f"rollouts {rollouts.scenario}: racer is {CHAMPION!r}, "
                    "expected a pair for which one comes with nathlon"
                )

    def _round(self, school: School) -> Status:
        """Drive and learn, and keep what came of it."""
        began, before = time.perf_counter(), self.updates
        rng = np.random.default_rng([self.seed, self._rounds])
        self._note(school, rng)
        loss = self._learn(rng)
        self._rounds += 1
        laps = LapEvaluation(math.nan, math.nan)
        due = self.updates // self.config.checkpoint_every > before // self.config.checkpoint_every
        if due or self._rounds == self._settings.rounds:
            laps = self._checkpoint(loss)
        self._keep(self._draw.weights)
        pace = (self.updates - before) / (time.perf_counter() - began)
        return Status(self.updates, self.transitions, pace, *laps)

    def _keep(self, weights: NDArray[np.float64]) -> None:
        """Put where it stands on disk, with the weights of its pairs; none before the first round."""
        tensors = self._pupil.trained.tensors()
        state = PolishState(self._rounds, self.updates, self.transitions, tensors, weights, self._curve)
        save_state(self.folder, state, self._facts)

    def _note(self, school: School, rng: np.random.Generator) -> None:
        """Hold the classes of a round, and write down what was said."""
        shares = self._settings.taught
        taught = shares[self._rounds] if self._rounds < len(shares) else 0.0
        races = [rollouts for rollouts in self.config.rollouts for _ in range(rollouts.worlds)]
        classes = [self._class(rollouts, taught, rng) for rollouts in races]
        notes = list(school.teach(classes, self._pupil.policy, self._pupil.note))
        for each, noted in zip(classes, notes, strict=True):
            if math.isfinite(noted.speed) and tells_pace(scenario_of(each.rollouts, each.pair)):
                self._draw.note(each.pair, noted.speed)
        rows = {
            name: torch.from_numpy(np.concatenate([noted.rows[name] for noted in notes]))
            for name in notes[0].rows
        }
        self.transitions += len(rows["said"])
        (self.folder / ROWS).mkdir(exist_ok=True)
        write_tensors(self._rows_of(self._rounds), rows)

    def _class(self, rollouts: Rollouts, taught: float, rng: np.random.Generator) -> Class:
        """Races of the next pair; of one of the champions' at full pace, where these teach."""
        pair, paces = self._draw.draw(rng), self._settings.paces
        pace = paces[int(rng.integers(len(paces)))]
        if rollouts.racer == CHAMPION:
            pair, pace = self._home[int(rng.integers(len(self._home)))], 1.0
        return Class(rollouts, pair, pace, taught, int(rng.integers(2**63)))

    def _rows_of(self, number: int) -> Path:
        return self.folder / ROWS / f"round-{number:05d}.safetensors"

    def _remembered(self) -> list[Rows]:
        """What was noted in the last rounds, as many as are remembered; older notes are removed."""
        parts: list[Rows] = []
        for number in range(self._rounds, -1, -1):
            path = self._rows_of(number)
            if not path.exists():
                break
            if sum(len(part["said"]) for part in parts) >= self.config.replay:
                path.unlink()
            else:
                parts.append(read_tensors(path))
        return parts

    def _learn(self, rng: np.random.Generator) -> float:
        """Go through what was said, in minibatches; their mean loss."""
        settings, total, losses = self.config.qrsac, self.config.updates, []
        due = round(total * (self._rounds + 1) / self._settings.rounds) - self.updates
        for loss in islice(self._pupil.losses(self._remembered(), rng), due):
            left = 0.5 + 0.5 * math.cos(math.pi * self.updates / total)
            rate = settings.policy_rate * (settings.final_rates + (1.0 - settings.final_rates) * left)
            self._pupil.trained.step(loss, rate)
            self.updates += 1
            self._pupil.trained.average(max(1.0 / self.updates, settings.averaging))
            losses.append(loss.item())
        return float(np.mean(losses))

    def _checkpoint(self, loss: float) -> LapEvaluation:
        """Write a checkpoint and a row of the curve."""
        card = self._card.model_copy(update={"step": self.updates, "transitions": self.transitions})
        path = self.folder / CHECKPOINTS / f"step-{self.updates:07d}.safetensors"
        with writing(path):
            save_checkpoint(path, self._pupil.averaged(), card)
        policy = open_checkpoint(path)
        laps = mean_laps(evaluate_laps(pair, policy, self.seed) for pair in self._evaluated)
        row = [[self._rounds, self.updates, self.transitions, loss, *laps]]
        self._curve = np.concatenate([self._curve, row])
        write_curve(self.folder, CURVE, self._curve)
        return laps

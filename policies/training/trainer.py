"""The training run: rollouts and updates, checkpoints, and going on after a stop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Literal

import numpy as np
import torch

from nathlon.policies.checkpoint import Card, open_checkpoint, save_checkpoint
from nathlon.policies.policy import Policy, StatelessPolicy
from nathlon.policies.qrsac.learner import QRSAC
from nathlon.policies.qrsac.recurrent import RecurrentNetwork
from nathlon.policies.qrsac.update import passages_of, windows_of
from nathlon.policies.replay_buffer.passages import PassageReplay, PassageTables
from nathlon.policies.replay_buffer.table import NStepReplay
from nathlon.policies.replay_buffer.tables import ReplayTables, apportion
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.evaluation import evaluate_laps, mean_laps
from nathlon.policies.training.log import Status, TrainingLog
from nathlon.policies.training.pairs import Pair, ready_pairs
from nathlon.policies.training.run_folder import (
    CHECKPOINTS,
    make_run_folder,
    newest_checkpoint,
    read_policy,
    read_run_folder,
)
from nathlon.policies.training.state import (
    REPLAY_FILE,
    STATE_FILE,
    RunState,
    load_state,
    read_tensors,
    save_state,
    write_tensors,
)
from nathlon.policies.training.worker import Experience, Gathered, News, WorkerSetup
from nathlon.policies.training.worker_pool import MakeWorkers, WorkerPool, local_workers
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import writing

ACTION_SIZE = 2
LOG_EVERY = 250
WORTH_COMPILING = 1_000
"""Updates of a run from which on compiling them takes less time than it saves."""


Device = Literal["cpu", "cuda"]


class Diverged(InputError):
    """Training that has come to numbers that are not finite."""


class Trainer:
    """One training run in a folder of its own."""

    def __init__(self, folder: Path, config: TrainingConfig, seed: int, device: Device = "cpu") -> None:
        """A run at its beginning; nothing is written yet.

        Args:
            device: where networks are updated; all else is on the CPU.

        Raises:
            InputError: if the configuration is for imitation, the replay tables are larger than memory, or
                there is no such device.
        """
        if config.imitation is not None:
            raise InputError("imitation: expected none in a training by rewards")
        if device == "cuda" and not torch.cuda.is_available():
            raise InputError("device: found no GPU that PyTorch can use for 'cuda', expected 'cpu'")
        self.folder, self.config, self.seed = folder, config, seed
        self.updates = self.transitions = self._checkpointed = 0
        replay, learner = np.random.SeedSequence(seed).spawn(2)
        self._rng = np.random.default_rng(replay)
        generator = torch.Generator(device).manual_seed(int(learner.generate_state(1)[0]))
        told = config.observation.critic_spec()
        self.learner = QRSAC(
            told.size,
            ACTION_SIZE,
            config.qrsac,
            generator,
            compiled=config.updates >= WORTH_COMPILING,
            updates=config.updates,
            facts=told.facts,
            recurrent=None if config.vision is None else seeing_network(self._card()),
        )
        self.replay = _tables(config)
        self._wall_s = 0.0
        self._owed = 0
        self._metrics: dict[str, torch.Tensor] = {}

    @classmethod
    def start(
        cls,
        folder: Path,
        config: TrainingConfig,
        seed: int,
        origin: Path | None = None,
        device: Device = "cpu",
    ) -> Trainer:
        """Begin a run in a new folder.

        Args:
            origin: folder of a run whose networks the new one starts with, or a checkpoint; of one, and of
                a run of imitation, it takes the policy, with new critics.
            device: where networks are updated.

        Raises:
            InputError: if the folder already holds a run or cannot be made, memory is too small, there is no
                such device, or the origin holds no state of networks of the same shape.
        """
        trainer = cls(folder, config, seed, device)
        if origin is not None:
            trainer._load_networks(origin)
        make_run_folder(folder, config, seed)
        if origin is not None:
            trainer._save_state()
        return trainer

    @classmethod
    def resume(cls, folder: Path, device: Device = "cpu") -> Trainer:
        """Go on with the run in a folder; replay tables that were not kept fill anew.

        Args:
            device: where networks are updated, of the same kind as before.

        Raises:
            InputError: if the folder holds no run, or one that cannot be read, or there is no such device.
        """
        trainer = cls(folder, *read_run_folder(folder), device)
        if (folder / STATE_FILE).exists():
            trainer._load_state()
        return trainer

    def _load_networks(self, origin: Path) -> None:
        if origin.is_file() or read_run_folder(origin)[0].imitation:
            self.learner.load_policy(read_policy(origin, self._card().shapes))
            return
        try:
            self.learner.load_networks(load_state(origin).learner)
        except InputError as error:
            raise InputError(f"{origin}: cannot be started from: {error}") from None

    def _load_state(self) -> None:
        state = load_state(self.folder)
        try:
            self.learner.load_state_dict(state.learner)
            kept = self.config.keep_replay and (self.folder / REPLAY_FILE).exists()
            if kept and isinstance(self.replay, ReplayTables):
                self.replay.load_state_dict(read_tensors(self.folder / REPLAY_FILE))
                # The episodes that were under way do not go on.
                for table in self.replay.tables:
                    table.drop_open()
        except InputError as error:
            raise InputError(f"{self.folder}: of another run: {error}") from None
        self.updates, self.transitions, self._wall_s = state.updates, state.transitions, state.wall_s
        self._checkpointed = state.updates
        self._rng.bit_generator.state = state.rng

    def run(
        self,
        on_status: Callable[[Status], None],
        on_pair: Callable[[int, int], None] = lambda *_: None,
        make_workers: MakeWorkers = local_workers,
    ) -> None:
        """Train to the end of the configuration, or until KeyboardInterrupt; either way the state is kept.

        Args:
            on_status: called every few hundred updates.
            on_pair: told how many pairs of a variety are ready, and of how many.
            make_workers: starts the rollout workers, on this machine by default.

        Raises:
            InputError: if training diverges, a rollout cannot be made or the disk is full; the last
                checkpoint and the last state are left as they are.
        """
        pairs, self._evaluated = ready_pairs(self.folder, self.config, on_pair)
        log = TrainingLog(self.folder, self.updates)
        workers = self._worker_pool(pairs, make_workers)
        began, first = time.perf_counter() - self._wall_s, self.updates
        started, next_log = time.perf_counter(), self.updates
        try:
            while self.updates < self.config.updates:
                self._gather(workers, log)
                self._wall_s = time.perf_counter() - began
                if self._owed < 1:
                    continue
                self._update()
                if self.updates % self.config.refresh_every == 0:
                    workers.tell(self._news())
                if self._checkpoint_is_due:
                    self._checkpoint(log)
                    workers.tell(self._news())
                if self.updates >= next_log:
                    next_log = self.updates + LOG_EVERY
                    self._check_metrics()
                    rate = (self.updates - first) / (time.perf_counter() - started)
                    on_status(log.progress(self.updates, self.transitions, rate, self._metrics))
            self._save()
        except KeyboardInterrupt:
            if self._checkpoint_is_due:
                self._checkpoint(log)
            self._save()
            raise
        finally:
            workers.close()
            log.close()

    def _worker_pool(self, pairs: Sequence[Pair], make: MakeWorkers) -> WorkerPool:
        # Episodes to come must not repeat those before a stop.
        seed = np.random.SeedSequence([self.seed, self.updates])
        return make(WorkerSetup(self.config, pairs, self.learner.policy_network, self._news(), seed))

    def _news(self) -> News:
        past = tuple(sorted((self.folder / CHECKPOINTS).glob("*.safetensors")))
        return News(self.learner.policy_parameters.numpy(), past)

    def _gather(self, workers: WorkerPool, log: TrainingLog) -> None:
        """Take in the steps that are done; wait for one if all updates that they earn are made."""
        for worker, gathered in workers.take(wait_for_one=self._owed < 1):
            if gathered is None:
                for table in self.replay.tables[worker :: _workers(self.config)]:
                    table.drop_open()
                continue
            self._remember(worker, gathered)
            log.note(gathered.tally)
            if self.replay.ready(self.config.warm_up):
                self._owed += self.config.updates_per_step

    def _remember(self, worker: int, gathered: Gathered) -> None:
        experience = gathered.experience
        if self.config.tables == "one":
            experience = [Experience.join(experience)]
        for place, (observation, step, hidden, memory) in enumerate(experience):
            table = self.replay.tables[place * _workers(self.config) + worker]
            if isinstance(table, NStepReplay):
                table.add(observation, *step)
            else:
                table.add(
                    observation,
                    memory,
                    hidden,
                    step.action,
                    step.reward,
                    step.terminated,
                    step.truncated,
                    step.valid,
                )
        self.transitions += gathered.tally.steps

    def _update(self) -> None:
        """All updates that are owed, but for those after the next policy or checkpoint is due."""
        config = self.config
        due = (every - self.updates % every for every in (config.refresh_every, config.checkpoint_every))
        count = min(self._owed, config.updates - self.updates, *due)
        self._metrics = self.learner.updates(lambda: self.replay.sample(self._rng), count)
        self.updates += count
        self._owed -= count

    @property
    def _checkpoint_is_due(self) -> bool:
        return self.updates % self.config.checkpoint_every == 0 and self.updates > self._checkpointed

    def _check_metrics(self) -> None:
        for name, value in self._metrics.items():
            if not math.isfinite(value):
                good = newest_checkpoint(self.folder)
                raise Diverged(
                    f"{self.folder}: training diverged by update {self.updates}, {name} is {float(value)}; "
                    f"the last good checkpoint is {good.name if good else 'none'}"
                )

    def _checkpoint(self, log: TrainingLog) -> None:
        """Write a checkpoint, a row of the curve and the state.

        The state comes last: who goes on from it finds the others, whenever this process was killed.
        """
        self._check_metrics()
        card = self._card()
        path = self.folder / CHECKPOINTS / f"step-{self.updates:07d}.safetensors"
        with writing(path):
            save_checkpoint(path, self.learner.policy_tensors(), card)
        policy: Policy
        if card.vision is None:
            policy = StatelessPolicy(card.observation, partial(self.learner.act, stochastic=False))
        else:
            policy = open_checkpoint(path)
        laps = mean_laps(evaluate_laps(pair, policy, self.seed) for pair in self._evaluated)
        self._checkpointed = self.updates
        log.checkpoint(self.updates, self.transitions, self._wall_s, laps, self._metrics)
        self._save_state()

    def _card(self) -> Card:
        """What the policy is now."""
        config = self.config
        return Card(
            format=2 if config.vision else 1,
            algorithm="QR-SAC" if config.qrsac.distributional else "SAC",
            hidden=config.qrsac.hidden,
            encoder=config.qrsac.encoder,
            practises=config.practises,
            vision=config.vision,
            observation=config.observation.spec(),
            circuit=config.circuit,
            car=config.car,
            scenarios=tuple(rollouts.scenario for rollouts in config.rollouts),
            step=self.updates,
            transitions=self.transitions,
            seed=self.seed,
            created_by={"nathlon": version("nathlon"), "torch": version("torch")},
        )

    def _save(self) -> None:
        self._save_state()
        if self.config.keep_replay and isinstance(self.replay, ReplayTables):
            write_tensors(self.folder / REPLAY_FILE, self.replay.state_dict())

    def _save_state(self) -> None:
        rng = self._rng.bit_generator.state
        learner = self.learner.state_dict()
        save_state(self.folder, RunState(self.updates, self.transitions, self._wall_s, learner, dict(rng)))


def seeing_network(card: Card) -> RecurrentNetwork:
    """The network of a policy that sees."""
    assert card.vision is not None, "who sees has a vision"
    return RecurrentNetwork(card.shapes, card.vision.strides, len(card.hidden), card.vision.memory)


def _workers(config: TrainingConfig) -> int:
    return max(config.workers, 1)


def _tables(config: TrainingConfig) -> ReplayTables | PassageTables:
    """A table for the experience of each worker in each rollout, or in all."""
    slots = [rollouts.worlds * rollouts.races * rollouts.learners for rollouts in config.rollouts]
    shares = list(config.shares)
    if config.tables == "one":
        slots, shares = [sum(slots)], [1.0]
    workers = _workers(config)
    slots = [cars for cars in slots for _ in range(workers)]
    shares = [share / workers for share in shares for _ in range(workers)]
    if config.vision is not None:
        example, told = config.observation.spec().blank(1), config.observation.critic_spec().size
        windows, memory = windows_of(config.qrsac), config.vision.memory
        return PassageTables(
            [
                PassageReplay(capacity, cars, example, told, ACTION_SIZE, memory, windows)
                for capacity, cars in zip(apportion(config.replay, shares), slots, strict=True)
            ],
            shares,
            passages_of(config.qrsac),
        )
    return ReplayTables(
        config.replay,
        slots,
        shares,
        config.qrsac.batch,
        config.observation.spec().size,
        ACTION_SIZE,
        config.qrsac.n_step,
        config.qrsac.gamma,
    )

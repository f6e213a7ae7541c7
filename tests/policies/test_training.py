"""Training runs: what they leave, going on after a stop, ends and cuts of episodes."""

from __future__ import annotations

import csv
import json
import os
import resource
import signal
from collections.abc import Callable
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
import torch

from nathlon.policies.checkpoint import SeeingPolicy, load_checkpoint, open_checkpoint, save_checkpoint
from nathlon.policies.hosting.spawned import Spawned
from nathlon.policies.policy import StatelessPolicy
from nathlon.policies.qrsac import learner
from nathlon.policies.qrsac.captured import Run
from nathlon.policies.qrsac.networks import Perceptron
from nathlon.policies.qrsac.update import Update
from nathlon.policies.replay_buffer.passages import PassageBatch
from nathlon.policies.replay_buffer.table import NStepReplay
from nathlon.policies.replay_buffer.tables import ReplayTables
from nathlon.policies.training import rewards, worker_pool
from nathlon.policies.training import trainer as training
from nathlon.policies.training.config import Rollouts, TrainingConfig, read_config
from nathlon.policies.training.evaluation import evaluate_laps
from nathlon.policies.training.log import CURVE_FILE, Status
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.rollout import Rollout
from nathlon.policies.training.run_folder import make_run_folder
from nathlon.policies.training.state import RunState, load_state, save_state
from nathlon.policies.training.trainer import WORTH_COMPILING, Trainer
from nathlon.policies.training.worker import News, RolloutWorker, WorkerSetup
from nathlon.policies.training.worker_pool import ProcessWorkers, Take
from nathlon.sim.clock import AGENT_DT
from nathlon.sim.errors import InputError
from nathlon.sim.state import CAR_STATE

pytestmark = pytest.mark.takes_long

PAIR = Pair("lindenring", "gt3")
SMALL = TrainingConfig.model_validate(
    {
        "circuit": "lindenring",
        "car": "gt3",
        "updates": 8,
        "updates_per_step": 2,
        "warm_up": 60,
        "replay": 500,
        "checkpoint_every": 8,
        "rollouts": [
            {"scenario": "1v0", "races": 3, "learners": 1},
            {"scenario": "1v3", "races": 1, "learners": 2, "opponents": ["driver:pace=0.9"]},
        ],
        "observation": {"course_points": 3, "cars_ahead": 1, "cars_behind": 1},
        "qrsac": {"hidden": [8, 8], "quantiles": 4, "batch": 16, "n_step": 3},
    }
)


def train(trainer: Trainer) -> list[Status]:
    seen: list[Status] = []
    trainer.run(seen.append)
    return seen


def test_the_same_seed_gives_the_same_checkpoints(tmp_path: Path) -> None:
    contents = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        train(Trainer.start(tmp_path / name, changed(checkpoint_every=4), seed))
        contents.append((tmp_path / name / "checkpoints" / "step-0000008.safetensors").read_bytes())
    assert contents[0] == contents[1]
    assert contents[0] != contents[2]
    assert_is_whole(tmp_path / "c")


def assert_is_whole(run: Path) -> None:
    """It has left checkpoints that drive, and a curve."""
    paths = sorted((run / "checkpoints").iterdir())
    assert [load_checkpoint(path).card.step for path in paths] == [4, 8]
    policy = load_checkpoint(paths[0])
    assert policy.card.seed == 2
    assert policy.card.scenarios == ("1v0", "1v3")
    assert policy.observation_spec == SMALL.observation.spec()
    rows = list(csv.DictReader((run / CURVE_FILE).open()))
    assert [int(row["updates"]) for row in rows] == [4, 8]
    assert list((run / "tensorboard").glob("events*"))


def test_updates_are_compiled_in_long_runs_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled: list[Update] = []

    def note(update: Update) -> Run:
        compiled.append(update)
        return update.in_place

    monkeypatch.setattr(learner, "_compiled", note)
    for updates, expected in ((WORTH_COMPILING - 1, 0), (WORTH_COMPILING, 1)):
        Trainer(tmp_path, changed(updates=updates), 1)
        assert len(compiled) == expected


def test_updates_in_a_row_are_those_made_one_by_one(tmp_path: Path) -> None:
    """No step of the rollouts comes between them, so that nothing depends on how often it is asked."""
    ends = []
    for every in (1, 3, 4):
        config = changed(updates=40, updates_per_step=4, refresh_every=every)
        trainer = Trainer.start(tmp_path / str(every), config, 1)
        train(trainer)
        ends.append(trainer.learner.policy_parameters)
    assert ends[0].equal(ends[2])
    assert not ends[0].equal(ends[1])


def test_a_device_that_is_not_there_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(InputError, match="found no GPU that PyTorch can use for 'cuda', expected 'cpu'"):
        Trainer.start(tmp_path / "run", SMALL, 1, device="cuda")
    assert not (tmp_path / "run").exists()


def test_resume_goes_on_from_the_stop(tmp_path: Path) -> None:
    trainer = Trainer.start(tmp_path, SMALL, seed=1)

    def stop(status: Status) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trainer.run(stop)
    stopped = trainer.learner.state_dict()
    again = Trainer.resume(tmp_path)
    assert again.updates == trainer.updates > 0
    assert again.transitions == trainer.transitions
    for name, tensor in again.learner.state_dict().items():
        assert tensor.equal(stopped[name]), name
    train(again)
    assert again.updates == SMALL.updates


@pytest.mark.parametrize("place", ["evaluate_laps", "save_checkpoint", "save_state"])
@pytest.mark.parametrize("end", [RuntimeError, KeyboardInterrupt])
def test_the_curve_is_whole_wherever_a_run_stops(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, end: type[BaseException]
) -> None:
    """The first error stands for a process that is killed: nothing is kept after it."""
    config = changed(updates=12, checkpoint_every=4)
    run = Trainer.start(tmp_path, config, seed=1)
    original = getattr(training, place)
    calls = iter(range(100))

    def stop(*args: object) -> object:
        if next(calls) == 1:
            raise end
        return original(*args)

    monkeypatch.setattr(training, place, stop)
    with pytest.raises(end):
        train(run)
    train(Trainer.resume(tmp_path))
    rows = [line.split(",")[0] for line in (tmp_path / "curve.csv").read_text().splitlines()]
    assert rows == ["updates", "4", "8", "12"]


def test_a_run_may_start_from_the_networks_of_another(tmp_path: Path) -> None:
    first = Trainer.start(tmp_path / "first", SMALL, seed=1)
    train(first)
    Trainer.start(tmp_path / "second", SMALL, seed=2, origin=tmp_path / "first")
    second = Trainer.resume(tmp_path / "second")
    theirs, ours = first.learner.state_dict(), second.learner.state_dict()
    for name in ("policy", "critic", "target", "average"):
        assert ours[name].equal(theirs[name]), name
    assert second.updates == ours["step"] == 0
    assert not ours["critic_square"].any()


def test_a_run_cannot_start_from_networks_of_another_shape(tmp_path: Path) -> None:
    train(Trainer.start(tmp_path / "first", SMALL, seed=1))
    wider = changed(qrsac=SMALL.qrsac.model_dump() | {"hidden": [8, 9]})
    with pytest.raises(InputError, match=r"first: cannot be started from: training state: tensor"):
        Trainer.start(tmp_path / "second", wider, seed=1, origin=tmp_path / "first")
    assert not (tmp_path / "second").exists()


@pytest.mark.parametrize("encoder", [(), (4, 2)])
def test_a_run_may_start_with_the_policy_of_a_checkpoint(tmp_path: Path, encoder: tuple[int, ...]) -> None:
    """Its critics are new."""
    qrsac = SMALL.qrsac.model_dump() | {"encoder": encoder}
    config = changed(observation=SMALL.observation.model_dump() | {"version": 3}, qrsac=qrsac)
    other, fresh = Trainer(tmp_path, config, 1), Trainer(tmp_path, config, 2).learner.state_dict()
    path = tmp_path / "policy.safetensors"
    save_checkpoint(path, other.learner.policy_tensors(), other._card())
    started = Trainer.start(tmp_path / "run", config, 2, origin=path).learner
    seen = np.random.default_rng(1).normal(size=(5, config.observation.spec().size)).astype(np.float32)
    told = started.act(seen, stochastic=False)
    kept, _ = load_checkpoint(path).act(seen, np.zeros((5, 0), np.float32))
    assert np.abs(told - kept).max() < 2e-3
    assert started.state_dict()["policy"].equal(started.state_dict()["average"])
    assert not started.state_dict()["policy"].equal(fresh["policy"])
    assert started.state_dict()["critic"].equal(fresh["critic"])

    with pytest.raises(
        InputError, match=r"policy.safetensors: cannot be started from: it has another network"
    ):
        Trainer.start(tmp_path / "wider", changed(), 2, origin=path)
    path.write_bytes(b"no checkpoint")
    with pytest.raises(InputError, match=r"policy.safetensors: not a whole safetensors file"):
        Trainer.start(tmp_path / "wider", config, 2, origin=path)
    with pytest.raises(InputError, match=r"none: no folder of a training run"):
        Trainer.start(tmp_path / "wider", config, 2, origin=tmp_path / "none")
    assert not (tmp_path / "wider").exists()


def changed(**changes: object) -> TrainingConfig:
    return TrainingConfig.model_validate(SMALL.model_dump() | changes)


def test_rates_that_fall_end_with_the_run(tmp_path: Path) -> None:
    """Updates after the middle of the run move the critics less than with constant rates."""
    moved = []
    for final in (1.0, 0.01):
        qrsac = SMALL.qrsac.model_dump() | {"final_rates": final, "critic_rate": 1e-3}
        trainer = Trainer.start(tmp_path / str(final), changed(qrsac=qrsac, updates_per_step=1), seed=1)
        train(trainer)
        state = trainer.learner.state_dict()
        trainer.learner.update(trainer.replay.sample(np.random.default_rng(0)))
        moved.append(float((trainer.learner.state_dict()["critic"] - state["critic"]).abs().max()))
    assert moved[1] < 0.05 * moved[0]


def test_a_kept_replay_is_there_after_a_stop(tmp_path: Path) -> None:
    trainer = Trainer.start(tmp_path, changed(keep_replay=True), seed=1)
    train(trainer)
    again = Trainer.resume(tmp_path)
    assert isinstance(again.replay, ReplayTables)
    assert isinstance(trainer.replay, ReplayTables)
    assert len(again.replay) == len(trainer.replay) > 0
    theirs, mine = (np.random.default_rng(5) for _ in range(2))
    for one, other in zip(trainer.replay.sample(theirs), again.replay.sample(mine), strict=True):
        assert isinstance(one, torch.Tensor)
        assert isinstance(other, torch.Tensor)
        assert one.equal(other)


def test_the_state_of_another_run_is_refused(tmp_path: Path) -> None:
    for name, hidden in (("a", [8, 8]), ("b", [8, 9])):
        train(Trainer.start(tmp_path / name, changed(qrsac=SMALL.qrsac.model_dump() | {"hidden": hidden}), 1))
    (tmp_path / "b" / "state.safetensors").replace(tmp_path / "a" / "state.safetensors")
    with pytest.raises(InputError, match="of another run: training state: tensor 'policy"):
        Trainer.resume(tmp_path / "a")


def test_a_state_that_does_not_fit_on_the_disk_leaves_the_old_one(tmp_path: Path) -> None:
    rng = dict(np.random.default_rng(1).bit_generator.state)
    save_state(tmp_path, RunState(3, 30, 1.0, {"x": torch.ones(1)}, rng))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
    try:
        with pytest.raises(InputError, match=r"state\.safetensors: cannot be written"):
            save_state(tmp_path, RunState(4, 40, 2.0, {"x": torch.ones(10_000)}, rng))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert load_state(tmp_path).updates == 3
    assert [path.name for path in tmp_path.iterdir()] == ["state.safetensors"]


def test_a_run_that_diverges_stops_and_keeps_its_last_checkpoint(tmp_path: Path) -> None:
    train(Trainer.start(tmp_path, SMALL, seed=1))
    good = {path.name: path.read_bytes() for path in (tmp_path / "checkpoints").iterdir()}
    state = (tmp_path / "state.safetensors").read_bytes()
    facts = (tmp_path / "run.json").read_text()
    (tmp_path / "run.json").write_text(
        facts.replace('"progress": 0.2', '"progress": 1e39').replace('"updates": 8', '"updates": 16')
    )
    with pytest.raises(InputError, match=r"diverged by update \d+.* last good checkpoint is step-0000008"):
        train(Trainer.resume(tmp_path))
    assert {path.name: path.read_bytes() for path in (tmp_path / "checkpoints").iterdir()} == good
    assert (tmp_path / "state.safetensors").read_bytes() == state


class TwoWorkers:
    """Two workers in this process, of which the second is another one from the tenth step on."""

    def __init__(self, setup: WorkerSetup) -> None:
        self._workers = [RolloutWorker(setup._replace(seed=each)) for each in setup.seed.spawn(2)]
        self._steps = 0

    def take(self, wait_for_one: bool) -> Take:
        if not wait_for_one:
            return []
        self._steps += 1
        if self._steps == 10:
            return [(1, None)]
        return [(index, worker.step()) for index, worker in enumerate(self._workers)]

    def tell(self, news: News) -> None:
        for worker in self._workers:
            worker.hear(news)

    def close(self) -> None:
        pass


def test_workers_gather_for_all_tables_and_episodes_of_a_lost_one_do_not_go_on(tmp_path: Path) -> None:
    trainer = Trainer.start(tmp_path, changed(workers=2, refresh_every=2), seed=1)
    dropped: list[tuple[int, bool]] = []
    for index, table in enumerate(trainer.replay.tables):
        assert isinstance(table, NStepReplay)
        drop = table.drop_open

        def noted(index: int = index, drop: Callable[[], None] = drop) -> None:
            dropped.append((index, trainer.replay.tables[index].gathered > 0))
            drop()

        table.drop_open = noted  # type: ignore[method-assign]
    trainer.run(lambda _: None, make_workers=TwoWorkers)
    assert trainer.updates == SMALL.updates
    assert [table.gathered > 0 for table in trainer.replay.tables] == [True] * 4
    assert len(list((tmp_path / "checkpoints").iterdir())) == 1
    assert dropped == [(1, True), (3, True)]  # a table for each rollout and worker


def test_processes_pass_messages_both_ways_that_no_pipe_holds() -> None:
    rollouts = [{"scenario": "1v0", "races": 1000, "learners": 1}]
    config = changed(workers=2, rollouts=rollouts)
    network = Perceptron((config.observation.spec().size, 512, 512, 4))
    news = News(network.initial(torch.Generator().manual_seed(1)).numpy(), ())
    workers = ProcessWorkers(WorkerSetup(config, [PAIR], network, news, np.random.SeedSequence(1)))
    taken: dict[int, list[np.ndarray]] = {0: [], 1: []}

    def exchange() -> None:
        while min(map(len, taken.values())) < 5:
            workers.tell(news)
            for worker, gathered in workers.take(wait_for_one=True):
                assert gathered is not None
                taken[worker].append(gathered.experience[0].observation)

    exchanging = Thread(target=exchange, daemon=True)
    exchanging.start()
    exchanging.join(120)
    workers.close()
    assert min(map(len, taken.values())) >= 5
    seeds = np.random.SeedSequence(1).spawn(2)
    for seen, seed in zip(taken.values(), seeds, strict=True):
        here = RolloutWorker(WorkerSetup(config, [PAIR], network, news, seed)).step()
        np.testing.assert_array_equal(seen[0], here.experience[0].observation)


class InThisProcess:
    """What makes processes, but they come to their end here as soon as they are started."""

    Pipe = staticmethod(Pipe)

    class Process:
        exitcode, pid = 0, 1 << 30  # of nobody

        def __init__(self, target: Callable[..., None], args: tuple, daemon: bool) -> None:
            self._do = partial(target, *args)

        def start(self) -> None:
            self._do()

        def kill(self) -> None:
            pass

        def join(self, timeout: float | None = None) -> None:
            pass


def test_a_worker_says_what_it_cannot_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_pool, "FreshProcesses", InThisProcess)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    rollouts = [{"scenario": "1v0", "races": 1, "learners": 2}]
    trainer = Trainer.start(tmp_path, changed(workers=1, rollouts=rollouts), seed=1)
    with pytest.raises(InputError, match="rollouts 1v0: learners is 2"):
        train(trainer)


@pytest.mark.skipif(os.name != "posix", reason="writes half messages")
def test_a_worker_that_does_not_end_its_message_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    ends: list[int] = []

    def begin_a_message(pipe: Connection, *_: object) -> None:
        os.write(pipe.fileno(), b"\0\0\1\0half")
        ends.append(os.dup(pipe.fileno()))  # as of a process that goes on

    monkeypatch.setattr(worker_pool, "FreshProcesses", InThisProcess)
    monkeypatch.setattr(worker_pool, "_serve", begin_a_message)
    monkeypatch.setattr(worker_pool, "Spawned", partial(Spawned, limit_s=0.0))
    config = changed(workers=1)
    network = Perceptron((config.observation.spec().size, 8, 4))
    news = News(network.initial(torch.Generator().manual_seed(1)).numpy(), ())
    workers = ProcessWorkers(WorkerSetup(config, [PAIR], network, news, np.random.SeedSequence(1)))
    with pytest.raises(InputError, match="rollout worker 1 sends what cannot be read: the rest of a message"):
        workers.take(wait_for_one=True)
    workers.close()
    os.close(*ends)


def test_one_table_takes_the_experience_of_all_rollouts(tmp_path: Path) -> None:
    trainer = Trainer.start(tmp_path, changed(tables="one"), seed=1)
    train(trainer)
    (table,) = trainer.replay.tables
    assert len(table) > SMALL.warm_up


def test_demonstrators_drive_in_the_learners_place() -> None:
    shown = Rollouts(scenario="time_trial", races=2, learners=1, demonstrators=("driver",))
    rollout = Rollout(SMALL, shown, PAIR, np.random.default_rng(0))
    for _ in range(300):
        step, _ = rollout.step(np.full((2, 2), -1.0, np.float32))
    assert (step.action != -1.0).all()
    state = rollout.episodes.world.state
    assert (state["progress"] > 600.0).all()
    assert (state["off_course_s"] < 1.0).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("", "no folder of a training run"),
        ("{", "run.json: Invalid JSON"),
        ('{"seed": 1, "config": {"circuit": 3}}', "config.circuit"),
        (json.dumps({"seed": True, "config": SMALL.model_dump(mode="json")}), "field seed is True"),
    ],
)
def test_a_folder_that_holds_no_run_cannot_be_resumed(tmp_path: Path, change: str, said: str) -> None:
    if change:
        (tmp_path / "run.json").write_text(change)
    with pytest.raises(InputError, match=said):
        Trainer.resume(tmp_path)


def test_a_folder_with_a_run_is_not_overwritten(tmp_path: Path) -> None:
    Trainer.start(tmp_path, SMALL, seed=1)
    with pytest.raises(InputError, match="already"):
        Trainer.start(tmp_path, SMALL, seed=1)


def test_a_stuck_car_terminates_and_a_time_limit_truncates() -> None:
    rollout = Rollout(SMALL, Rollouts(scenario="1v0", races=2, learners=1), PAIR, np.random.default_rng(0))
    braking = np.array([[-1.0, 0.0]] * 2, np.float32)
    ends = []
    for _ in range(120):
        step, _ = rollout.step(braking)
        assert not (step.terminated & step.truncated).any()
        ends.append((step.terminated.copy(), step.valid.copy()))
        if step.terminated.any():
            break
    assert ends[-1][0].any()
    # 5 s at rest after braking: within 12 s, and never before 5 s.
    assert len(ends) > 50
    rollout.episodes.limit_s[:] = 0.05
    step, _ = rollout.step(braking)
    assert step.truncated.all()
    assert not step.terminated.any()
    assert (rollout.episodes.world.time == 0.0).all()


def test_the_final_observation_is_the_one_before_the_reset() -> None:
    rollout = Rollout(SMALL, Rollouts(scenario="1v0", races=1, learners=1), PAIR, np.random.default_rng(0))
    rollout.episodes.limit_s[:] = 0.05
    step, _ = rollout.step(np.zeros((1, 2), np.float32))
    assert step.truncated.all()
    assert not np.array_equal(step.next_observation, rollout.observation)


def test_steering_costs_the_square_of_its_change() -> None:
    before, after = np.zeros((2, 1, 2), CAR_STATE)
    before["steering"], after["steering"] = [[0.1, -0.1]], [[0.1, 0.2]]
    np.testing.assert_allclose(rewards.steering(before, after), [[0.0, -0.09]])


def test_every_shipped_configuration_reads() -> None:
    folder = Path(read_config.__code__.co_filename).parent / "configs"
    for path in folder.glob("*.toml"):
        assert read_config(path).rollouts


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("circuit = 1", "circuit"),
        ("[", "not a TOML file"),
        ("wheels = 4", "updates: Field required"),
    ],
)
def test_a_wrong_configuration_names_file_and_field(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "config.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as error:
        read_config(path)
    assert str(path) in str(error.value)


def seeing(**changes: object) -> TrainingConfig:
    camera = {"camera": {"width": 24, "height": 16}}
    vision = {"convolutions": [{"filters": 3, "side": 8, "stride": 4}], "features": 5, "memory": 4}
    qrsac = SMALL.qrsac.model_dump() | {"passage": 4, "recalled": 1, "policy_waits": 4} | changes
    return changed(observation=camera, vision=vision, qrsac=qrsac)


def test_critics_of_a_policy_that_sees_are_told_numbers_and_it_goes_on_from_what_it_was_taught(
    tmp_path: Path,
) -> None:
    lessons = TrainingConfig.model_validate(seeing().model_dump() | {"imitation": {"teacher": "champion"}})
    make_run_folder(tmp_path / "taught", lessons, 1)
    own = Trainer(tmp_path, seeing(), 1)._card()
    rng = np.random.default_rng(1)
    tensors = {
        name: rng.normal(0.0, 0.1, shape).astype(np.float16).astype(np.float32)
        for name, shape in own.shapes.items()
    }
    save_checkpoint(tmp_path / "taught" / "checkpoints" / "step-0000001.safetensors", tensors, own)

    trainer = Trainer.start(tmp_path / "run", seeing(), 1, origin=tmp_path / "taught")
    before = trainer.learner.state_dict()
    np.testing.assert_array_equal(
        trainer.learner.policy_tensors()["vision.0.weight"], tensors["vision.0.weight"].astype(np.float32)
    )
    train(trainer)
    after = trainer.learner.state_dict()
    assert trainer.updates == 8
    assert not any(after[name].equal(before[name]) for name in ("policy", "critic"))
    told = seeing().observation.critic_spec()
    batch = trainer.replay.sample(np.random.default_rng(1))
    assert batch.observation.shape == (5 * 3, told.size)
    assert isinstance(batch, PassageBatch)
    assert batch.seen[1].shape == (5, 5, 16, 24, 3)
    assert batch.memory.abs().max() > 0.0
    policy = open_checkpoint(tmp_path / "run" / "checkpoints" / "step-0000008.safetensors")
    assert isinstance(policy, SeeingPolicy)
    assert policy.card.algorithm == "QR-SAC"
    assert Trainer.resume(tmp_path / "run").learner.policy_parameters.equal(after["policy"])


def test_a_policy_that_waits_stays_as_it_was(tmp_path: Path) -> None:
    trainer = Trainer.start(
        tmp_path / "run", changed(qrsac=SMALL.qrsac.model_dump() | {"policy_waits": 8}), 1
    )
    before = trainer.learner.state_dict()
    train(trainer)
    after = trainer.learner.state_dict()
    assert after["policy"].equal(before["policy"])
    assert not after["critic"].equal(before["critic"])


@pytest.mark.parametrize(("pedal", "steering"), [(0.0, 0.0), (0.5, 1.0)], ids=["at rest", "in circles"])
def test_a_trial_ends_where_a_policy_gets_nowhere(pedal: float, steering: float) -> None:
    asked: list[int] = []

    def act(observations: np.ndarray) -> np.ndarray:
        asked.append(len(observations))
        return np.tile(np.array([pedal, steering], np.float32), (len(observations), 1))

    laps = evaluate_laps(PAIR, StatelessPolicy(SMALL.observation.spec(), act), seed=1)
    assert np.isnan(laps.lap_s)
    assert len(asked) < 60.0 / AGENT_DT

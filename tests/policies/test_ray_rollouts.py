"""Rollouts of a training run, and whole runs, on the nodes of a Ray cluster."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from nathlon.api.train import train
from nathlon.arena.on_ray.cluster import joined
from nathlon.policies.qrsac.networks import Perceptron
from nathlon.policies.training.ablation import AblationRun, configurations, train_in_turn
from nathlon.policies.training.config import TrainingConfig, read_config
from nathlon.policies.training.log import Status
from nathlon.policies.training.on_ray import runs
from nathlon.policies.training.on_ray import workers as workers_module
from nathlon.policies.training.on_ray.actor import Begin, RolloutActor
from nathlon.policies.training.on_ray.run_actor import Report, RunActor, RunStart
from nathlon.policies.training.on_ray.runs import train_on_cluster
from nathlon.policies.training.on_ray.travel import Arrived, needed, pack
from nathlon.policies.training.on_ray.workers import RayWorkers
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.trainer import Trainer
from nathlon.policies.training.worker import News, RolloutWorker, WorkerSetup
from nathlon.policies.training.worker_pool import STEPS_AHEAD, LocalWorkers
from nathlon.sim.decisive import fingerprint
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED
from tests.support.trainings import TOML

if TYPE_CHECKING:
    from ray.cluster_utils import Cluster

pytestmark = pytest.mark.takes_long

PAIR = Pair("lindenring", "gt3")
ONE = {
    "circuit": "lindenring",
    "car": "gt3",
    "updates": 8,
    "updates_per_step": 2,
    "refresh_every": 2,
    "warm_up": 60,
    "replay": 600,
    "checkpoint_every": 2,
    "workers": 1,
    "rollouts": [{"scenario": "1v0", "races": 3, "learners": 1}],
    "observation": {"course_points": 3, "cars_ahead": 1, "cars_behind": 1},
    "qrsac": {"hidden": [8], "quantiles": 4, "batch": 16, "n_step": 3},
}
CONFIG = TrainingConfig.model_validate(ONE)
NETWORK = Perceptron((CONFIG.observation.spec().size, 8, 4))


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """A head without processors and a node with two."""
    from ray.cluster_utils import Cluster

    with pytest.MonkeyPatch.context() as patch:
        # What is compiled already.
        patch.setenv("XDG_CACHE_HOME", os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache"))
        # Ray has its processes give way to all others, and beside other tests they would hardly begin.
        patch.setenv("RAY_worker_niceness", "0")
        head = {"num_cpus": 0, "include_dashboard": False, "object_store_memory": 100 << 20}
        cluster = Cluster(initialize_head=True, head_node_args=head)
        try:
            cluster.add_node(num_cpus=2, object_store_memory=100 << 20, node_ip_address="127.0.1.2")
            yield cluster
        finally:
            cluster.shutdown()


@pytest.fixture(scope="module")
def member(cluster: Cluster) -> Iterator[None]:
    with joined(cluster.address):
        yield


def news_of(throttle: float) -> News:
    """A policy that gives so much throttle, whatever it sees and hardly ever anything else."""
    parameters = torch.zeros_like(NETWORK.initial(torch.Generator().manual_seed(1)))
    parameters[-4] = throttle
    parameters[-2:] = -20.0
    return News(parameters.numpy(), ())


def workers_of(config: TrainingConfig = CONFIG) -> RayWorkers:
    return RayWorkers(WorkerSetup(config, [PAIR], NETWORK, news_of(3.0), np.random.SeedSequence(1)))


def test_a_worker_does_what_one_here_does_and_hears_news_within_the_steps_that_it_may_be_ahead(
    member: None,
) -> None:
    """And one that is lost is replaced by another, with races of its own."""
    import ray

    [seed] = np.random.SeedSequence(1).spawn(1)
    here = RolloutWorker(WorkerSetup(CONFIG, [PAIR], NETWORK, news_of(3.0), seed))
    workers = workers_of()
    throttle: list[float] = []
    starts: list[np.ndarray] = []
    try:
        for number in range(20):
            if number == 10:
                workers.tell(news_of(-3.0))
            [(index, there)] = workers.take(wait_for_one=True)
            assert index == 0
            assert there is not None
            [(seen, step, *_)] = there.experience
            starts.append(seen)
            throttle.append(float(step.action[0, 0]))
            if number >= 10:
                continue
            [(own_seen, own, *_)] = here.step().experience
            assert seen.dtype == step.next_observation.dtype == np.float16
            np.testing.assert_array_equal(seen, own_seen.astype(np.float16))
            own = own._replace(next_observation=own.next_observation.astype(np.float16))
            for name, values in own._asdict().items():
                np.testing.assert_array_equal(getattr(step, name), values, name)
        ray.kill(workers._hands[0].actor)
        while workers.take(wait_for_one=True) != [(0, None)]:
            pass
        [(index, another)] = workers.take(wait_for_one=True)
        assert index == 0
        assert another is not None
        [(seen, step, *_)] = another.experience
        assert seen.shape == starts[0].shape
        assert not np.array_equal(seen, starts[0])
        assert step.action[0, 0] < 0
    finally:
        workers.close()
    first = next(number for number, value in enumerate(throttle) if value < 0)
    assert 10 <= first <= 10 + STEPS_AHEAD
    assert all(value < 0 for value in throttle[first:])


CROWDED = CONFIG.model_copy(update={"rollouts": (CONFIG.rollouts[0].model_copy(update={"learners": 2}),)})
"""More cars of the learner's than there are."""
REFUSAL = "rollouts 1v0: learners is 2, expected"


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Actors may be made in this process, which keeps its caches where they are."""
    monkeypatch.setenv("XDG_CACHE_HOME", os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache"))


@pytest.mark.usefixtures("here")
def test_actors_refuse_what_they_cannot_do() -> None:
    begin = Begin(fingerprint(), CROWDED, [PAIR], NETWORK, [])
    rollouts, run = RolloutActor("rollout worker 1"), RunActor("training of base")
    with pytest.raises(InputError, match=f"^{REFUSAL}"):
        rollouts.begin(begin, np.random.SeedSequence(1), news_of(3.0))
    with pytest.raises(InputError, match=r"^rollout worker 1 on .* has another nathlon"):
        rollouts.begin(begin._replace(code="other"), np.random.SeedSequence(1), news_of(3.0))
    with pytest.raises(InputError, match=r"^training of base on .* has another nathlon"):
        run.train(RunStart("other", CROWDED, 1, [], {}))
    with pytest.raises(InputError, match=f"^{REFUSAL}"):
        run.train(RunStart(fingerprint(), CROWDED, 1, [], {}))


@pytest.mark.usefixtures("here")
def test_an_actor_whose_run_diverges_says_so() -> None:
    steep = CONFIG.model_copy(
        update={"workers": 0, "reward": CONFIG.reward.model_copy(update={"progress": 1e300})}
    )
    actor = RunActor("training of base")
    assert "training diverged" in actor.train(RunStart(fingerprint(), steep, 1, [], {}))
    assert not [name for name in actor.report().files if "checkpoints" in name]


def test_a_worker_says_what_it_cannot_do(member: None, monkeypatch: pytest.MonkeyPatch) -> None:
    class Refusing(RolloutActor):  # travels by value from here
        def ready(self) -> None:
            raise InputError(REFUSAL)

    monkeypatch.setattr(workers_module, "RolloutActor", Refusing)
    workers = workers_of()
    with pytest.raises(InputError, match=f"^{REFUSAL}$"):
        workers.take(wait_for_one=True)
    workers.close()


def test_files_are_found_where_they_have_come_to(tmp_path: Path) -> None:
    circuit = tmp_path / "pairs" / "street-7"
    circuit.mkdir(parents=True)
    (circuit / "circuit.toml").write_text("a")
    (circuit / "centre_line.csv").write_text("b")
    (tmp_path / "car.toml").write_text("c")
    weights = str(BUNDLED[0])
    opponents = [weights, "driver:pace=0.9", "past"]
    config = TrainingConfig.model_validate(
        ONE | {"rollouts": [{"scenario": "1v3", "races": 1, "learners": 1, "opponents": opponents}]}
    )
    pairs = [Pair(str(circuit), str(tmp_path / "car.toml")), Pair("lindenring", "gt3")]
    names = needed(config, pairs)
    assert names == [weights, str(circuit), str(tmp_path / "car.toml")]
    arrived = Arrived()
    arrived.unpack(map(pack, names))
    policies = [opponent.policy for opponent in arrived.config(config).rollouts[0].opponents]
    assert policies[1:] == opponents[1:]
    assert Path(policies[0]).read_bytes() == Path(weights).read_bytes()
    assert policies[0] != weights
    there, home = arrived.pairs(pairs)
    assert home == pairs[1]
    assert Path(there.circuit).name == "street-7"
    assert (Path(there.circuit) / "centre_line.csv").read_text() == "b"
    assert Path(there.car).read_text() == "c"


def test_a_run_goes_on_against_its_own_checkpoints(cluster: Cluster, tmp_path: Path) -> None:
    text = TOML.replace('opponents = ["driver"]', 'opponents = ["driver", "past"]')
    file, run = tmp_path / "run.toml", tmp_path / "run"
    file.write_text(text.replace("updates = 4", "workers = 1\nupdates = 4"))
    Trainer.start(run, read_config(file), 1).run(lambda _: None, make_workers=in_this_process)
    facts = run / "run.json"
    facts.write_text(facts.read_text().replace('"updates": 4', '"updates": 8'))
    last = train(out=run, resume=True, engine="ray", engine_address=cluster.address, progress=False)
    assert (last.updates, len(last.checkpoints)) == (8, 4)


def in_this_process(setup: WorkerSetup) -> LocalWorkers:
    """One worker, whatever the configuration says."""
    return LocalWorkers(RolloutWorker(setup))


def test_a_cluster_needs_to_know_how_many_workers(cluster: Cluster, tmp_path: Path) -> None:
    config = tmp_path / "run.toml"
    config.write_text(TOML)
    with pytest.raises(InputError, match="workers is 0, expected how many"):
        train(config, tmp_path / "run", engine="ray", engine_address=cluster.address, progress=False)
    assert not (tmp_path / "run").exists()


RUNS = tuple(configurations(CONFIG.model_copy(update={"workers": 0}), ["n-step-1"]).items())


def run_of(folder: Path, which: int = 0, **changes: object) -> AblationRun:
    name, config = RUNS[which]
    return AblationRun(name, 1, folder / name, config.model_copy(update=changes))


def contents(folder: Path) -> dict[str, bytes]:
    """Checkpoints of a run, and its curve but for how long it took."""
    files = {path.name: path.read_bytes() for path in folder.rglob("*.safetensors") if "step" in path.name}
    rows = [row.split(",") for row in (folder / "curve.csv").read_text().splitlines()]
    return files | {"curve": repr([row[:2] + row[3:] for row in rows]).encode()}


def test_whole_runs_come_to_what_they_come_to_here(
    member: None, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One whose process is lost, too: it goes on from its last checkpoint, as one that was stopped here."""
    import ray

    class Brief(RunActor):  # travels by value from here
        """The first of the base halts at its first status, which comes after a checkpoint."""

        def train(self, start: RunStart) -> str:
            self._halts = self._name == "training of base, seed 1" and not halted.exists()
            if self._halts:
                halted.touch()
            return super().train(start)

        def _note(self, status: Status) -> None:
            super()._note(status)
            while self._halts:
                time.sleep(1.0)

    def stop(status: Status) -> None:
        raise KeyboardInterrupt

    def on_status(run: AblationRun, status: Status) -> None:
        told.add(str(run))
        if run.variant == "base" and run.updates and not lost:
            lost.append(run.updates)
            [name] = [name for name in ray.util.list_named_actors() if name.endswith(str(run))]
            ray.kill(ray.get_actor(name))

    monkeypatch.setattr(runs, "RunActor", Brief)
    halted = tmp_path / "halted"
    torch.set_num_threads(1)
    here, there = ([run_of(tmp_path / name, which) for which in (0, 1)] for name in ("here", "there"))
    with pytest.raises(KeyboardInterrupt):
        here[0].trainer().run(stop)
    assert here[0].updates == 2
    assert list(train_in_turn(here, lambda *_: None)) == ["", ""]
    told: set[str] = set()
    lost: list[int] = []
    assert list(train_on_cluster(there, on_status)) == ["", ""]
    assert told == {"base, seed 1", "n-step-1, seed 1"}
    assert lost == [2]
    assert "base, seed 1 is lost" in caplog.text
    for mine, others in zip(here, there, strict=True):
        assert others.finished
        assert len(contents(mine.folder)) == 5
        assert contents(others.folder) == contents(mine.folder)
        assert list((others.folder / "tensorboard").iterdir())
        assert others.trainer().config == mine.config


def test_how_a_run_ends_is_told(member: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Ending(RunActor):  # travels by value from here
        def train(self, start: RunStart) -> str:
            if start.seed == 1:
                return "training diverged"
            raise InputError(REFUSAL)

        def report(self) -> Report:
            return Report(None, {})

    monkeypatch.setattr(runs, "RunActor", Ending)
    config = run_of(tmp_path).config
    for seed in (1, 2):
        run = AblationRun("base", seed, tmp_path / str(seed), config)
        if seed == 1:
            assert list(train_on_cluster([run], lambda *_: None)) == ["training diverged"]
        else:
            with pytest.raises(InputError, match=f"^{REFUSAL}$"):
                list(train_on_cluster([run], lambda *_: None))
        assert not run.finished

"""Rollouts of a training run, and whole runs, on the nodes of a Ray cluster."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch

from nathlon.api.training import train
from nathlon.arena.on_ray.cluster import joined
from nathlon.policies.qrsac.networks import Perceptron
from nathlon.policies.training.ablation import Run, configurations, train_in_turn
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.log import Status
from nathlon.policies.training.on_ray import runs
from nathlon.policies.training.on_ray.run_actor import RunActor, Start
from nathlon.policies.training.on_ray.runs import train_on_cluster
from nathlon.policies.training.on_ray.travel import Arrived, needed, pack
from nathlon.policies.training.on_ray.workers import RayWorkers
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.trainer import Trainer
from nathlon.policies.training.worker import News, RolloutWorker
from nathlon.policies.training.worker_pool import STEPS_AHEAD
from nathlon.sim.errors import InputError
from tests.checkpoints import BUNDLED
from tests.trainings import TOML

if TYPE_CHECKING:
    from ray.cluster_utils import Cluster

pytestmark = [pytest.mark.takes_long, pytest.mark.usefixtures("uncompiled")]

PAIR = Pair("lindenring", "gt3")
ONE = {
    "circuit": "lindenring",
    "car": "gt3",
    "updates": 8,
    "updates_per_step": 2,
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
    """A head without processors and two nodes with one each."""
    from ray.cluster_utils import Cluster

    with pytest.MonkeyPatch.context() as patch:
        # What is compiled already.
        patch.setenv("XDG_CACHE_HOME", os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache"))
        # Ray has its processes give way to all others, and beside other tests they would hardly begin.
        patch.setenv("RAY_worker_niceness", "0")
        head = {"num_cpus": 0, "include_dashboard": False, "object_store_memory": 100 << 20}
        cluster = Cluster(initialize_head=True, head_node_args=head)
        try:
            for place in (2, 3):
                address = f"127.0.1.{place}"
                cluster.add_node(num_cpus=1, object_store_memory=100 << 20, node_ip_address=address)
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
    return RayWorkers(config, [PAIR], NETWORK, news_of(3.0), np.random.SeedSequence(1))


def test_a_worker_does_what_one_here_does_and_hears_news_within_the_steps_that_it_may_be_ahead(
    member: None,
) -> None:
    [seed] = np.random.SeedSequence(1).spawn(1)
    here = RolloutWorker(CONFIG, [PAIR], NETWORK, news_of(3.0), seed)
    workers = workers_of()
    throttle: list[float] = []
    try:
        for number in range(20):
            if number == 10:
                workers.tell(news_of(-3.0))
            [(index, there)] = workers.take(wait_for_one=True)
            assert index == 0
            assert there is not None
            [(seen, step)] = there.experience
            throttle.append(float(step.action[0, 0]))
            if number >= 10:
                continue
            [(own_seen, own)] = here.step().experience
            assert seen.dtype == step.next_observation.dtype == np.float16
            np.testing.assert_array_equal(seen, own_seen.astype(np.float16))
            own = own._replace(next_observation=own.next_observation.astype(np.float16))
            for name, values in own._asdict().items():
                np.testing.assert_array_equal(getattr(step, name), values, name)
    finally:
        workers.close()
    first = next(number for number, value in enumerate(throttle) if value < 0)
    assert 10 <= first <= 10 + STEPS_AHEAD
    assert all(value < 0 for value in throttle[first:])


def test_a_worker_that_is_lost_is_replaced_and_its_episodes_do_not_go_on(
    member: None, tmp_path: Path
) -> None:
    import ray

    made: list[RayWorkers] = []

    def make(*arguments: Any) -> RayWorkers:
        made.append(RayWorkers(*arguments))
        return made[0]

    # However long the other one takes to begin: updates go on until it has made steps.
    config = TrainingConfig.model_validate(
        ONE | {"workers": 2, "updates": 200_000, "checkpoint_every": 200_000}
    )
    trainer = Trainer.start(tmp_path, config, 1)
    dropped: Counter[int] = Counter()
    gathered: list[int] = []
    for index, table in enumerate(trainer.replay.tables):
        drop = table.drop_open

        def counted(index: int = index, drop: Any = drop) -> None:
            dropped[index] += 1
            gathered.append(trainer.replay.tables[index].gathered)
            drop()

        table.drop_open = counted  # type: ignore[method-assign]

    def on_status(status: Status) -> None:
        if not dropped:
            ray.kill(made[0]._hands[1].actor)
        elif trainer.replay.tables[1].gathered > gathered[0] + 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trainer.run(on_status, make_workers=make)
    assert dropped == {1: 1}


def test_a_worker_says_what_it_cannot_do(member: None) -> None:
    rollouts = [{"scenario": "1v0", "races": 1, "learners": 2}]
    workers = workers_of(TrainingConfig.model_validate(ONE | {"rollouts": rollouts}))
    with pytest.raises(InputError, match=r"^rollouts 1v0: learners is 2, expected"):
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
    config, run = tmp_path / "run.toml", tmp_path / "run"
    text = TOML.replace('opponents = ["driver"]', 'opponents = ["driver", "past"]')
    config.write_text(text.replace("updates = 4", "workers = 1\nupdates = 4"))
    first = train(config, run, engine="ray", engine_address=cluster.address, progress=False)
    assert (first.updates, len(first.checkpoints)) == (4, 2)
    facts = run / "run.json"
    facts.write_text(facts.read_text().replace('"updates": 4', '"updates": 6'))
    last = train(out=run, resume=True, engine="ray", engine_address=cluster.address, progress=False)
    assert (last.updates, len(last.checkpoints)) == (6, 3)


def test_a_cluster_needs_to_know_how_many_workers(cluster: Cluster, tmp_path: Path) -> None:
    config = tmp_path / "run.toml"
    config.write_text(TOML)
    with pytest.raises(InputError, match="workers is 0, expected how many"):
        train(config, tmp_path / "run", engine="ray", engine_address=cluster.address, progress=False)
    assert not (tmp_path / "run").exists()


RUNS = tuple(configurations(CONFIG.model_copy(update={"workers": 0}), ["n-step-1"]).items())


def run_of(folder: Path, which: int = 0, **changes: object) -> Run:
    name, config = RUNS[which]
    return Run(name, 1, folder / name, config.model_copy(update=changes))


@pytest.fixture
def uncompiled_there(member: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """What `uncompiled` is here, for actors that train."""

    class Uncompiled(RunActor):  # travels by value from here
        def train(self, start: Start) -> str:
            with torch.compiler.set_stance("force_eager"):
                return super().train(start)

    monkeypatch.setattr(runs, "RunActor", Uncompiled)


def contents(folder: Path) -> dict[str, bytes]:
    """Checkpoints of a run, and its curve but for how long it took."""
    files = {path.name: path.read_bytes() for path in folder.rglob("*.safetensors") if "step" in path.name}
    rows = [row.split(",") for row in (folder / "curve.csv").read_text().splitlines()]
    return files | {"curve": repr([row[:2] + row[3:] for row in rows]).encode()}


def test_whole_runs_come_to_what_they_come_to_here(uncompiled_there: None, tmp_path: Path) -> None:
    torch.set_num_threads(1)
    here, there = ([run_of(tmp_path / name, which) for which in (0, 1)] for name in ("here", "there"))
    assert list(train_in_turn(here, lambda *_: None)) == ["", ""]
    told: set[str] = set()
    assert list(train_on_cluster(there, lambda run, status: told.add(str(run)))) == ["", ""]
    assert told == {"base, seed 1", "n-step-1, seed 1"}
    for mine, others in zip(here, there, strict=True):
        assert others.finished
        assert len(contents(mine.folder)) == 5
        assert contents(others.folder) == contents(mine.folder)
        assert list((others.folder / "tensorboard").iterdir())
        assert others.trainer().config == mine.config


def test_a_run_whose_process_is_lost_goes_on_from_its_last_checkpoint(
    uncompiled_there: None, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    import ray

    run = run_of(tmp_path, updates=3_000, checkpoint_every=500)
    lost: list[int] = []

    def on_status(run: Run, status: Status) -> None:
        if run.updates and not lost:
            lost.append(run.updates)
            [name] = [name for name in ray.util.list_named_actors() if "nathlon training" in name]
            ray.kill(ray.get_actor(name))

    assert list(train_on_cluster([run], on_status)) == [""]
    assert "base, seed 1 is lost" in caplog.text
    assert lost[0] >= 500
    assert run.finished
    curve = (run.folder / "curve.csv").read_text().splitlines()[1:]
    assert [int(row.split(",")[0]) for row in curve] == [500, 1000, 1500, 2000, 2500, 3000]


def test_a_run_that_diverges_there_says_so(uncompiled_there: None, tmp_path: Path) -> None:
    reward = CONFIG.reward.model_copy(update={"progress": 1e300})
    [why] = train_on_cluster([run_of(tmp_path, reward=reward)], lambda *_: None)
    assert "training diverged" in why
    assert not run_of(tmp_path).finished


def test_an_ablation_says_what_is_wrong_with_a_run(uncompiled_there: None, tmp_path: Path) -> None:
    rollouts = (CONFIG.rollouts[0].model_copy(update={"learners": 2}),)
    with pytest.raises(InputError, match=r"^rollouts 1v0: learners is 2, expected"):
        list(train_on_cluster([run_of(tmp_path, rollouts=rollouts)], lambda *_: None))

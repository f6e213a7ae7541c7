"""Training runs beside each other: what they leave, and which of them end early."""

from __future__ import annotations

import re
from pathlib import Path
from textwrap import indent
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import nathlon
from nathlon.arena.statistics import Floats
from nathlon.arena.store import Store
from nathlon.lab.siblings.proof import RISK, proved_worse
from nathlon.lab.siblings.run import KIND, TrainingRun, checkpoints
from nathlon.sim.errors import InputError

LOOKS = 20
PAGE = Path(__file__).parent.parent.parent / "docs" / "siblings.md"


def trained(folder: Path, name: str, skill: float, noise: float = 10.0) -> int:
    """Train a toy whose returns grow with its skill; its checkpoints."""
    run = TrainingRun(folder, name, checkpoints=LOOKS, stop_if_worse_by=20.0)
    rng = np.random.default_rng(len(name))
    for step in range(1, LOOKS + 1):
        luck = np.random.default_rng(run.seeds(step, 1)).normal(0, 100, 12)  # of the episodes, for all
        returns = skill * step + luck + rng.normal(0, noise, 12)
        if run.checkpoint(step, lambda path: path.write_bytes(b"policy"), returns.tolist()):
            return step
    return LOOKS


def test_what_is_worse_than_a_sibling_ends_and_the_store_knows(tmp_path: Path) -> None:
    taken = [trained(tmp_path, name, skill) for name, skill in (("good", 20.0), ("bad", 5.0), ("fair", 19.5))]
    assert taken[0] == taken[2] == LOOKS
    assert LOOKS / 4 < taken[1] < LOOKS / 2
    with Store(tmp_path / "store.sqlite") as store:
        known = checkpoints(store)
    assert [(one.run, one.step) for one in known if one.stopped] == [("bad", taken[1])]
    assert len(known) == sum(taken)
    assert (tmp_path / "bad" / f"policy_{taken[1]}_steps.zip").read_bytes() == b"policy"


@pytest.mark.parametrize("stopped", [True, False])
def test_who_was_stopped_stops_nobody(tmp_path: Path, stopped: bool) -> None:
    far_better = {"run": "gone", "step": LOOKS, "returns": [1e4 + i for i in range(12)], "stopped": stopped}
    run = TrainingRun(tmp_path, "own", checkpoints=1, stop_if_worse_by=20.0)
    with Store(tmp_path / "store.sqlite") as store:
        store.append(KIND, far_better)
    assert run.checkpoint(LOOKS, Path.touch, list(range(0, 24, 2))) is not stopped


@pytest.mark.parametrize("kind", ["normal", "skewed", "rare", "won or lost"])
def test_equals_are_stopped_no_more_often_than_said(kind: str) -> None:
    rng = np.random.default_rng(5)

    def draw() -> Floats:
        if kind == "normal":
            return rng.normal(0, 100, 24)
        if kind == "won or lost":
            return np.where(rng.random(4) < 0.5, 100.0, 0.0)
        if kind == "skewed":
            return np.asarray(-100.0 * rng.pareto(3.0, 24), np.float64)
        return np.where(rng.random(24) < 0.1, -1000.0, 0.0)

    runs = 200
    stopped = sum(
        any(proved_worse(draw(), [draw(), draw()], 50.0, LOOKS) for _ in range(LOOKS)) for _ in range(runs)
    )
    assert stopped <= runs * RISK


def test_a_step_that_comes_twice_is_one_look_and_there_are_no_more_than_said(tmp_path: Path) -> None:
    run = TrainingRun(tmp_path, "own", checkpoints=8, stop_if_worse_by=20.0)
    far_better = {"run": "other", "returns": [1e4 + i for i in range(12)], "stopped": False}
    with Store(tmp_path / "store.sqlite") as store:
        for step in (2, 3, 9):
            store.append(KIND, far_better | {"step": step})
    ends = [run.checkpoint(step, Path.touch, list(range(0, 24, 2))) for step in (1, 1, *range(2, 10))]
    assert [number for number, end in enumerate(ends) if end] == [3], "not in the first quarter, nor a ninth"


def test_other_numbers_of_episodes_are_not_compared() -> None:
    assert not proved_worse(np.zeros(24), [np.full(12, 1e3)], 1.0, LOOKS)
    assert proved_worse(np.zeros(24), [np.full(24, 1e3)], 1.0, LOOKS)


def test_returns_that_are_no_numbers_are_refused(tmp_path: Path) -> None:
    run = TrainingRun(tmp_path, "run", checkpoints=3)
    with pytest.raises(InputError, match="returns of run at step 1 are not a row of finite numbers"):
        run.checkpoint(1, Path.touch, [1.0, float("nan")])
    assert not list(run.folder.iterdir())
    with pytest.raises(InputError, match="stop_if_worse_by is -1"):
        TrainingRun(tmp_path, "run", checkpoints=3, stop_if_worse_by=-1)


def test_stable_baselines_saves_what_nathlon_reads(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    import gymnasium
    from stable_baselines3 import A2C
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    from nathlon.policies.sources.normalisation import companions

    wrapped = VecNormalize(DummyVecEnv([lambda: gymnasium.make("CartPole-v1")] * 3))
    env = gymnasium.make("CartPole-v1", max_episode_steps=20)
    callback = nathlon.NathlonCallback(tmp_path, "seed-1", env, checkpoints=4, episodes=2)
    A2C("MlpPolicy", wrapped, seed=1, device="cpu").learn(200, callback=callback)
    zips = sorted(path.name for path in (tmp_path / "seed-1").glob("*.zip"))
    assert zips == [f"policy_{step}_steps.zip" for step in (100, 150, 200, 50)]
    assert companions(tmp_path / "seed-1" / zips[0]).statistics is not None
    with Store(tmp_path / "store.sqlite") as store:
        assert [one.step for one in checkpoints(store)] == [50, 100, 150, 200]
    assert callback.stopped_at is None


@pytest.mark.parametrize("library", ["CleanRL", "RLlib", "Lightning"])
def test_what_the_page_shows_for_other_loops_runs(
    library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The libraries themselves are not needed: the lines take a module, a step and a way to end."""
    torch = pytest.importorskip("torch")
    monkeypatch.chdir(tmp_path)
    page = PAGE.read_text("utf-8")
    begun, shown = (
        re.findall(rf"{title}.*?```python\n(.*?)```", page, re.DOTALL)[0]
        for title in ("## Any other loop", f"\n{library}")
    )
    module = torch.nn.Linear(3, 1)
    names: dict[str, Any] = {
        "nathlon": nathlon,
        "torch": torch,
        "agent": module,
        "algorithm": SimpleNamespace(get_module=lambda: module),
        "episode": lambda policy, seed: float(policy(torch.ones(3))) + seed % 7,
        "seed": 1,
    }
    exec(begun, names)
    if library == "Lightning":
        exec(shown, names)
        trainer = SimpleNamespace(global_step=500, should_stop=False)
        names["on_validation_end"](None, trainer, module)
        assert trainer.should_stop is False
    else:
        exec(f"for global_step in (500, 1000):\n    step = global_step\n{indent(shown, '    ')}", names)
    saved = tmp_path / "runs" / "pendulum" / "seed-1" / "policy_500_steps.pt"
    assert torch.load(saved, weights_only=True)["weight"].shape == (1, 3)
    with Store(tmp_path / "runs" / "pendulum" / "store.sqlite") as store:
        assert [one.step for one in checkpoints(store)][:1] == [500]

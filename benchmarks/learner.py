"""Updates a second of the learner beside Stable-Baselines3's SAC and sb3-contrib's TQC at equal sizes.

Run as `python -m benchmarks.learner --json FILE`. All learners see observations of 231 numbers, act in two,
have twin critics and sample their own replay for each update. Ours and TQC estimate 32 quantiles a critic,
SAC the mean. The weight of the entropy is fixed for all, which spares the others an optimiser. Each has a
process of its own, as ours tells the C library what to do with freed memory; they take turns, so that what
else the machine does meets all of them alike. The entries of the JSON:

- `sizes`: for each shape of the networks and batch
    - `ours`, `ours_float32`, `sb3_sac`, `tqc`: updates a second of wall time, medians over the turns; the
      first two are one figure where the processor has no instructions for bfloat16;
    - `ratio`: ours over each other; `float32_ratio`: the same for ours in float32;
    - `gflop`: floating-point operations in the matrix products of one of our updates, in billions;
    - `peak_share`: of what the processor does in one large matrix product of ours' precision, the share that
      our updates reach, counting nothing but their matrix products; `float32_peak_share` in float32;
    - `compile_s`: wall time of our first update, float32;
- `peak_gflops`: that large product (2,048 x 2,048), the best turn, by precision;
- `threads`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box
from rich.console import Console
from rich.progress import track
from sb3_contrib import TQC
from stable_baselines3 import SAC
from stable_baselines3.common.logger import configure
from torch.utils.flop_counter import FlopCounterMode

from benchmarks.learner_sizes import (
    ACTION,
    ALPHA,
    OBSERVATION,
    SIZES,
    STORED,
    our_config,
    our_replay,
)
from benchmarks.result import write_result
from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.learner import QRSAC, fast_precision
from nathlon.policies.replay_buffer.table import NStepReplay

TURNS = 9
TURN_S = 0.5
"""Of one learner, at least; one update where that takes longer."""
PEAK_WIDTH = 2048

THEIRS: dict[str, type[SAC] | type[TQC]] = {"sb3_sac": SAC, "tqc": TQC}

Updates = Callable[[int], object]
"""Makes so many updates."""


class Space(gymnasium.Env[Any, Any]):
    """Nothing but the spaces, from which the other learners take their sizes."""

    observation_space = Box(-np.inf, np.inf, (OBSERVATION,), np.float32)
    action_space = Box(-1.0, 1.0, (ACTION,), np.float32)


def ours(
    config: QRSACConfig, replay: NStepReplay, rng: np.random.Generator, compiled: bool = True
) -> Updates:
    """Updates of ours."""
    learner = QRSAC(OBSERVATION, ACTION, config, torch.Generator().manual_seed(0), compiled)

    def update(count: int) -> None:
        for _ in range(count):
            learner.update(replay.sample(config.batch, rng))

    return update


def theirs(kind: type[SAC] | type[TQC], config: QRSACConfig, rng: np.random.Generator) -> Updates:
    """Updates of SAC or TQC with a replay full of noise."""
    critics: dict[str, Any] = {"n_critics": 2} | ({"n_quantiles": config.quantiles} if kind is TQC else {})
    model = kind(
        "MlpPolicy",
        Space(),
        buffer_size=STORED,
        ent_coef=ALPHA,
        policy_kwargs={"net_arch": list(config.hidden), **critics},
        device="cpu",
        seed=0,
    )
    model.set_logger(configure(None, []))
    replay = model.replay_buffer
    assert replay is not None
    replay.observations[:] = rng.standard_normal(replay.observations.shape, np.float32)
    replay.next_observations[:] = rng.standard_normal(replay.observations.shape, np.float32)
    replay.actions[:] = rng.uniform(-1.0, 1.0, replay.actions.shape)
    replay.rewards[:] = rng.standard_normal(replay.rewards.shape, np.float32)
    replay.full = True
    return lambda count: model.train(count, config.batch)


def product(precision: torch.dtype) -> Updates:
    """Large matrix products, for the peak of the processor."""
    factors = torch.randn(2, PEAK_WIDTH, PEAK_WIDTH).to(precision)

    def multiply(count: int) -> None:
        for _ in range(count):
            factors[0] @ factors[1]

    return multiply


def timed(updates: Updates, count: int) -> float:
    """Seconds of wall time for one of `count` updates."""
    began = time.perf_counter()
    updates(count)
    return (time.perf_counter() - began) / count


def operations(updates: Updates) -> int:
    """Floating-point operations (multiplications and additions) in the matrix products of one update."""
    with FlopCounterMode(display=False) as counter:
        updates(1)
    return int(counter.get_total_flops())


def contestant(name: str, hidden: tuple[int, ...], batch: int) -> Updates:
    """Who goes by that name in `measure`, at a size."""
    rng = np.random.default_rng(0)
    kind, _, precision = name.partition(" ")
    config = our_config(hidden, batch, precision or "float32")
    if kind == "product":
        return product(getattr(torch, precision))
    if kind == "ours":
        return ours(config, our_replay(rng), rng)
    return theirs(THEIRS[kind], config, rng)


class Contender:
    """A contestant in a process of its own.

    Attributes:
        first_s: wall time of the first update, in seconds.
        count: of updates in a turn.
        seconds: for one update, of each turn.
    """

    _updates: ClassVar[Updates]

    def __init__(self, name: str, hidden: tuple[int, ...], batch: int, threads: int) -> None:
        self._process = ProcessPoolExecutor(
            1, get_context("spawn"), Contender._begin, (name, hidden, batch, threads)
        )
        self.first_s = self._timed(1)
        self.count = max(1, round(TURN_S / self._timed(1)))
        self.seconds: list[float] = []

    @staticmethod
    def _begin(name: str, hidden: tuple[int, ...], batch: int, threads: int) -> None:
        torch.set_num_threads(threads)
        Contender._updates = contestant(name, hidden, batch)

    @staticmethod
    def _time(count: int) -> float:
        return timed(Contender._updates, count)

    def _timed(self, count: int) -> float:
        return self._process.submit(Contender._time, count).result()

    def take_turn(self) -> None:
        """Times one turn."""
        self.seconds.append(self._timed(self.count))

    def end(self) -> None:
        """Ends the process."""
        self._process.shutdown()


def measure(
    hidden: tuple[int, ...], batch: int, threads: int, console: Console
) -> tuple[dict[str, Any], dict[str, float]]:
    """The entry of one size, and the peak in Gflop/s by precision."""
    fast = str(fast_precision(torch.device("cpu"))).removeprefix("torch.")
    precisions = dict.fromkeys(("float32", fast))
    names = [f"{kind} {precision}" for precision in precisions for kind in ("ours", "product")]
    contenders = {name: Contender(name, hidden, batch, threads) for name in (*names, "sb3_sac", "tqc")}
    for _ in track(range(TURNS), f"{'x'.join(map(str, hidden))}, batch {batch}", console=console):
        for contender in contenders.values():
            contender.take_turn()
    for contender in contenders.values():
        contender.end()

    rate = {name: 1.0 / float(np.median(contender.seconds)) for name, contender in contenders.items()}
    rate |= {"ours": rate[f"ours {fast}"], "ours_float32": rate["ours float32"]}
    peak = {
        precision: 2e-9 * PEAK_WIDTH**3 / min(contenders[f"product {precision}"].seconds)
        for precision in precisions
    }
    rng = np.random.default_rng(0)
    plain = our_config(hidden, batch, "float32")
    gflop = 1e-9 * operations(ours(plain, our_replay(rng), rng, compiled=False))
    return {
        **{name: round(rate[name], 2) for name in ("ours", "ours_float32", "sb3_sac", "tqc")},
        "ratio": {name: round(rate["ours"] / rate[name], 2) for name in ("sb3_sac", "tqc")},
        "float32_ratio": {name: round(rate["ours_float32"] / rate[name], 2) for name in ("sb3_sac", "tqc")},
        "gflop": round(gflop, 3),
        "peak_share": round(gflop * rate["ours"] / peak[fast], 3),
        "float32_peak_share": round(gflop * rate["ours_float32"] / peak["float32"], 3),
        "compile_s": round(contenders["ours float32"].first_s, 1),
    }, peak


def main() -> None:
    """Measure all sizes, show progress on stderr and write the JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, required=True, metavar="FILE")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    console = Console(stderr=True)
    sizes: dict[str, Any] = {}
    peaks: dict[str, float] = {}
    for name, (hidden, batch) in SIZES.items():
        sizes[name], peak = measure(hidden, batch, options.threads, console)
        peaks = {precision: max(peaks.get(precision, 0.0), value) for precision, value in peak.items()}
        # After each size: the largest takes long, and may not fit in memory.
        figures = {
            "sizes": sizes,
            "peak_gflops": {precision: round(value, 1) for precision, value in peaks.items()},
            "threads": options.threads,
        }
        versions = {package: version(package) for package in ("stable-baselines3", "sb3-contrib")}
        write_result(options.json, figures, versions)


if __name__ == "__main__":
    main()

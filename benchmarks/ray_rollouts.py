"""Whether a training whose rollouts run on a Ray cluster learns as one with rollouts in processes here.

`python -m benchmarks.ray_rollouts [--seeds N] [--updates N] [--workers N] [--json PATH]` trains a small
network alone on Lindenring, once with a rollout worker in a process of this machine (`local`) and once with
one on a node of a cluster on this machine (`ray`), each with the same seeds. With one worker the order in
which everything happens is fixed, and both should come to the same; with more (`--workers`), what happens
at the same time differs from run to run, and only the distributions should be alike.

Figures: `updates` of a run; `rows`, one for each checkpoint and measure of the training curve: `updates`,
`measure`; `local` and `ray`, the values by seed; `difference` of their means (ray less local) with its 95 %
interval `low`, `high` by Welch's t, and `p`.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np
from scipy import stats

import nathlon
from benchmarks.result import write_result
from benchmarks.scale_out import OBJECTS_BYTES

MEASURES = {"mean_q": "mean value", "entropy": "entropy", "off_course_share": "share of time off course"}
"""Of a training curve, in which every checkpoint has a number."""
CONFIG = """
circuit = "lindenring"
car = "gt3"
updates = {updates}
updates_per_step = 4
warm_up = 1000
replay = 20000
checkpoint_every = {every}
workers = {workers}
refresh_every = 4

[[rollouts]]
scenario = "1v0"
races = 16
learners = 1

[observation]
course_points = 6
cars_ahead = 0
cars_behind = 0

[qrsac]
hidden = [32, 32]
quantiles = 8
batch = 64
n_step = 5
"""


def curve(config: Path, out: Path, engine: Literal["local", "ray"], address: str, seed: int) -> Any:
    """The training curve of a run."""
    result = nathlon.train(
        config, out, seed=seed, threads=1, engine=engine, engine_address=address, progress=False
    )
    return result.curve


def compared(local: list[float], ray: list[float]) -> dict[str, Any]:
    """How the means of two groups of seeds differ."""
    test = stats.ttest_ind(ray, local, equal_var=False)
    low, high = test.confidence_interval(0.95)
    return {
        "local": [round(value, 5) for value in local],
        "ray": [round(value, 5) for value in ray],
        "difference": round(float(np.mean(ray) - np.mean(local)), 5),
        "low": round(float(low), 5),
        "high": round(float(high), 5),
        "p": round(float(test.pvalue), 3),
    }


def main() -> None:
    """Train, compare, print, and keep the figures."""
    from ray.cluster_utils import Cluster

    parser = argparse.ArgumentParser(prog="benchmarks.ray_rollouts", description="Rollouts on a Ray cluster")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--updates", type=int, default=2400)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", type=Path, help="where to write the figures")
    asked = parser.parse_args()
    head = {"num_cpus": 0, "include_dashboard": False, "object_store_memory": OBJECTS_BYTES}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    curves: dict[str, list[Any]] = {"local": [], "ray": []}
    try:
        cluster.add_node(num_cpus=asked.workers, object_store_memory=OBJECTS_BYTES)
        with TemporaryDirectory() as folder:
            config = Path(folder) / "run.toml"
            config.write_text(
                CONFIG.format(updates=asked.updates, every=asked.updates // 3, workers=asked.workers)
            )
            for seed in range(1, asked.seeds + 1):
                for engine in curves:
                    out = Path(folder) / f"{engine}-{seed}"
                    curves[engine].append(curve(config, out, engine, cluster.address, seed))  # type: ignore[arg-type]
                    print(f"{engine}, seed {seed}", file=sys.stderr, flush=True)
    finally:
        cluster.shutdown()
    rows = []
    for index, updates in enumerate(curves["local"][0]["updates"]):
        for measure in MEASURES:
            groups = {name: [float(one[measure][index]) for one in group] for name, group in curves.items()}
            rows.append({"updates": updates, "measure": measure, **compared(**groups)})
    print(json.dumps(rows, indent=1))
    if asked.json:
        import ray

        write_result(asked.json, {"updates": asked.updates, "rows": rows}, {"ray": ray.__version__})


if __name__ == "__main__":
    main()

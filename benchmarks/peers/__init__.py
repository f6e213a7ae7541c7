"""Speed of other racing and driving simulators, beside which that of our world stands.

`python -m benchmarks.peers --install` fetches the peers that packages offer into the user's cache,
`python -m benchmarks.peers` measures those found and prints one JSON object as its last line:

- `torcs_8`, `torcs_20`: TORCS without graphics, with its own drivers (see `benchmarks.peers.torcs`);
- `gpudrive`: PufferLib's driving environment in C (see `benchmarks.peers.gpudrive`);
- `highway_env_grid_20`, `highway_env_kinematics_20`: racetrack of highway-env with 20 controlled cars (see
  `benchmarks.peers.highway`);
- `car_racing_image`, `car_racing_no_image`: CarRacing of Gymnasium (see `benchmarks.peers.car_racing`).

Two figures stand for each, measured in a process of its own on one core:

- `agent_steps_per_s_core`: decisions observed and acted upon, of all cars, a CPU second;
- `car_seconds_per_cpu_second`: simulated seconds times cars, a CPU second, observing included.

Starts, resets and the choice of actions are not counted, save where a module says so. How much physics and
observation a step holds differs widely: the modules say what is simulated. f1tenth_gym is not among the
peers, since no package index offers it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.peers.install import PYTHON

if TYPE_CHECKING:
    # The environments of the peers have no rich.
    from rich.console import Console

Figures = dict[str, float]

OURS = ("torcs",)
"""Modules that need nothing but the standard library."""
THEIRS = ("gpudrive", "highway", "car_racing")
"""Modules that run in the environment of the peers."""
TIME_LIMIT_S = 900.0


def run(interpreter: Path, module: str) -> dict[str, Figures]:
    """Figures that a module prints; `OSError` or `subprocess.SubprocessError` where it fails."""
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [interpreter, "-m", f"benchmarks.peers.{module}"],
        env={**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"},
        check=True,
        capture_output=True,
        text=True,
        timeout=TIME_LIMIT_S,
    )
    figures: dict[str, Figures] = json.loads(done.stdout.splitlines()[-1])
    return figures


def measure(console: Console) -> dict[str, Figures]:
    """Figures of every peer that runs, by name; says in a sentence why any other is left out."""
    figures: dict[str, Figures] = {}
    for module in (*OURS, *THEIRS):
        interpreter = Path(sys.executable) if module in OURS else PYTHON
        try:
            figures |= run(interpreter, module)
        except FileNotFoundError:
            console.print(f"{module} is left out: run `python -m benchmarks.peers --install` first.")
        except subprocess.CalledProcessError as error:
            reason = (
                error.stderr.strip().splitlines()[-1] if error.stderr.strip() else f"exit {error.returncode}"
            )
            console.print(f"{module} is left out: {reason}", markup=False)
        except subprocess.TimeoutExpired:
            console.print(f"{module} is left out: it took more than {TIME_LIMIT_S:.0f} s.")
    return figures

"""What gates say of candidates whose truth is known: ours, and those of others on the same laps.

`python -m benchmarks.gate_table --json FILE [--gates 1000] [--beside physim-gate=PYTHON ...]` draws time
trials of candidate and champion from the same starts. For each candidate and gate, `pass` and `fail` are
shares of the gates, `laps` what it took in the mean. Ours has 192 laps at most, as by default; the others
have the first 64 of the same, in an interpreter of their own (`benchmarks.gate_beside`).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from benchmarks.error_rates.gates import SETTINGS, Runs, judged
from benchmarks.result import write_result
from nathlon.arena.statistics import Floats
from nathlon.judge.gate.questions import Errors

SEED = 2_031
LAP_S = 100.0
MARGIN_S = 0.5
NOISE_S = 1.0
"""Standard deviation of the difference of two laps."""
OTHERS = 64
"""Laps that the others have."""
WORKER = Path(__file__).with_name("gate_beside.py")


class Kind(NamedTuple):
    """A candidate: by how much its lap is longer, s, how laps vary, and how often both break down."""

    slower_s: float
    noise: Callable[[np.random.Generator, int], Floats]
    ours: float
    theirs: float


def normal(rng: np.random.Generator, laps: int) -> Floats:
    """As far to the one side as to the other."""
    return rng.standard_normal(laps)


def skewed(rng: np.random.Generator, laps: int) -> Floats:
    """Mostly a little too short, and now and then much longer: log-normal, standardised."""
    drawn = np.exp(rng.standard_normal(laps))
    return np.asarray((drawn - np.exp(0.5)) / np.sqrt((np.e - 1) * np.e))


KINDS = {
    "equal": Kind(0.0, normal, 0.0, 0.0),
    "worse by the margin": Kind(MARGIN_S, normal, 0.0, 0.0),
    "breaks down in 0.5 %": Kind(0.0, normal, 0.005, 0.0),
    "breaks down in 1 %": Kind(0.0, normal, 0.01, 0.0),
    "breaks down in 2 %": Kind(0.0, normal, 0.02, 0.0),
    "breaks down in 5 %": Kind(0.0, normal, 0.05, 0.0),
    "breaks down in 20 %": Kind(0.0, normal, 0.2, 0.0),
    "worse by the margin, skewed": Kind(MARGIN_S, skewed, 0.0, 0.0),
    "both break down in 20 %, equal": Kind(0.0, normal, 0.2, 0.2),
}


def laps(kind: Kind, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """(N,) laps of candidate and champion, s; NaN where one broke down."""
    most = SETTINGS.runs
    theirs = LAP_S + rng.normal(0.0, 0.2, most)
    ours = theirs + kind.slower_s + NOISE_S * kind.noise(rng, most)
    broke = rng.uniform(size=(2, most)) < np.array([[kind.ours], [kind.theirs]])
    return np.where(broke[0], np.nan, ours), np.where(broke[1], np.nan, theirs)


def ours_says(candidate: Floats, champion: Floats) -> tuple[str, int]:
    """The gate of this package."""
    errors = Errors(SETTINGS.alpha, SETTINGS.beta, SETTINGS.block, SETTINGS.breakdowns)
    gains = 100.0 * (1.0 - candidate / champion) / (100.0 * MARGIN_S / LAP_S)
    verdict, taken = judged(Runs(gains, np.isnan(candidate), np.isnan(champion)), errors, len(candidate))
    return verdict.value, taken


def others_say(
    python: str, name: str, drawn: list[tuple[Floats, Floats]]
) -> tuple[str, list[tuple[str, int]]]:
    """The version of another package, and what its gate says, in an interpreter that has it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "laps.json"
        rows = [[[None if np.isnan(lap) else lap for lap in one[:OTHERS]] for one in two] for two in drawn]
        path.write_text(json.dumps(rows))
        command = [python, str(WORKER), name, str(path), str(MARGIN_S / LAP_S), str(SETTINGS.breakdowns)]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    told = json.loads(done.stdout.splitlines()[-1])
    return told["version"], [(verdict, OTHERS) for verdict in told["said"]]


def shares(said: list[tuple[str, int]]) -> dict[str, float]:
    """What a gate says of many draws."""
    verdicts = [verdict for verdict, _ in said]
    return {
        "pass": round(verdicts.count("pass") / len(said), 4),
        "fail": round(verdicts.count("fail") / len(said), 4),
        "laps": round(float(np.mean([taken for _, taken in said])), 1),
    }


def measure(gates: int, beside: dict[str, str], others: int) -> dict[str, Any]:
    """The figures, by candidate and gate."""
    figures: dict[str, Any] = {}
    versions: dict[str, str] = {}
    for number, (name, kind) in enumerate(KINDS.items()):
        rng = np.random.default_rng([SEED, number])
        drawn = [laps(kind, rng) for _ in range(gates)]
        told = {"nathlon": shares([ours_says(*two) for two in drawn])}
        for other, python in beside.items():
            versions[other], said = others_say(python, other, drawn[:others])
            told[other] = shares(said)
        figures[name] = told
    return {
        "gates": gates,
        "gates_of_others": others,
        "laps_of_others": OTHERS,
        "versions": versions,
        "candidates": figures,
    }


def main() -> None:
    """Measure, print and, if asked, write the figures."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--gates", type=int, default=1000)
    parser.add_argument("--others", type=int, default=300, help="gates of the others, who take longer")
    parser.add_argument("--beside", action="append", default=[], metavar="NAME=PYTHON")
    chosen = parser.parse_args()
    beside = dict(one.split("=", 1) for one in chosen.beside)
    figures = measure(chosen.gates, beside, chosen.others)
    Console().print_json(data=figures)
    if chosen.json:
        write_result(chosen.json, figures)


if __name__ == "__main__":
    main()

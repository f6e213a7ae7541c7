"""How many preferences the trajectory alignment coefficient (TAC) needs, with judges that err.

`python -m benchmarks.tac --json FILE [--plot FILE.png]` has the library's drivers drive clips from `STARTS`
starts of the Lindenring, and draws `CANDIDATES` fit formulas from the embedded sampler. A judge prefers what
the default rule of `nathlon reward design` prefers, and says the opposite with a known probability. The true
rank of the formulas is that of their TAC with a judge without error on all pairs from half of the starts;
preferences are drawn from the other half.

Figures: by error of the judge and number of preferences, over `REPEATS` draws of preferences: `rank`, the
mean of Kendall's tau between TAC and truth over all formulas, with `rank_low` and `rank_high`, its tenth and
ninetieth percentile; `best_kept`, how often the truly best of ten formulas is among the five with the highest
TAC, where chance is a half; and `shortfall`, by how much the true TAC of the best one kept falls short of the
best of ten. Besides `truth`, the median, tenth and ninetieth percentile of true TACs, and `drivers`,
`starts`, `formulas`, `repeats`.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import kendalltau

from benchmarks.result import write_result
from nathlon.lab.reward.alignment import returns
from nathlon.lab.reward.candidates import Brief
from nathlon.lab.reward.clips import Clips, Studio
from nathlon.lab.reward.judging import EQUAL
from nathlon.lab.reward.library import DRIVER, library
from nathlon.lab.reward.measures import RULE, marks, measure, read_rule
from nathlon.lab.reward.sampling import Sampler
from nathlon.lab.reward.vetting import vet
from nathlon.policies.training.config import CONFIGS, read_config
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import whole_file

STARTS, CANDIDATES, REPEATS = 16, 60, 400
ERRORS = (0.0, 0.1, 0.25, 0.4)
"""Of judges. Two people agree in 78.5 % of pairs (arXiv 2511.02094), as two do who err in 12 % each."""
NUMBERS = (25, 50, 100, 200, 400)
OF, KEPT = 10, 5
"""Formulas of a round, and those kept."""
SEED = 7

Signs = NDArray[np.float64]


def orders(values: Signs, starts: range) -> Signs:
    """Who of two is better, (pairs,), for all pairs from the same start; of values (drivers, starts)."""
    pairs = [(i, j, start) for start in starts for i, j in combinations(range(len(values)), 2)]
    first, second, at = np.array(pairs).T
    return np.asarray(np.sign(values[first, at] - values[second, at]))


def formulas(clips: dict[str, Clips], step_s: float, gamma: float) -> list[Signs]:
    """Returns (drivers, starts) of fit formulas."""
    found: list[Signs] = []
    sampler, attempt = Sampler(SEED), 0
    while len(found) < CANDIDATES:
        for proposal in sampler.propose(Brief("", 1, attempt, CANDIDATES)):
            try:
                vetted = vet(proposal.formula, clips, gamma, step_s)
            except InputError:
                continue
            found.append(np.stack([returns(vetted.expression, one) for one in clips.values()]))
        attempt += 1
    return found[:CANDIDATES]


def judged(truth: Signs, error: float, rng: np.random.Generator) -> Signs:
    """What a judge says of pairs, who errs with a probability; what is alike stays so."""
    return np.where(rng.random(truth.shape) < error, -truth, truth)


def figures() -> dict[str, Any]:
    """All of them."""
    config = read_config(CONFIGS / "design.toml")
    studio = Studio(config.circuit, config.car, STARTS)
    with tempfile.TemporaryDirectory() as folder:
        clips = library(studio, Path(folder), SEED)
    rule = read_rule(RULE)
    value = np.array(
        [[marks(rule, one) for one in measure(each, clips[DRIVER], studio.step_s)] for each in clips.values()]
    )
    value = np.round(value / EQUAL) * EQUAL
    used, held_out = range(STARTS // 2), range(STARTS // 2, STARTS)
    valued = formulas(clips, studio.step_s, config.qrsac.gamma)
    truth = np.array([(orders(each, held_out) * orders(value, held_out)).mean() for each in valued])
    found, wanted = np.stack([orders(each, used) for each in valued]), orders(value, used)
    rng = np.random.default_rng(SEED)
    rows = [
        {"error": error, "preferences": number, **_predicted(found, wanted, truth, error, number, rng)}
        for error in ERRORS
        for number in NUMBERS
    ]
    low, middle, high = np.quantile(truth, [0.1, 0.5, 0.9]).round(3).tolist()
    return {
        "drivers": len(clips),
        "starts": STARTS,
        "formulas": CANDIDATES,
        "repeats": REPEATS,
        "truth": [middle, low, high],
        "rows": rows,
    }


def _predicted(
    found: Signs, wanted: Signs, truth: Signs, error: float, number: int, rng: np.random.Generator
) -> dict[str, float]:
    ranks, kept, short = [], [], []
    for _ in range(REPEATS):
        drawn = rng.permutation(len(wanted))[:number]
        tac = (found[:, drawn] * judged(wanted[drawn], error, rng)).mean(axis=1)
        ranks.append(float(kendalltau(tac, truth).statistic))
        some = rng.permutation(len(truth))[:OF]
        # Ties in either order: those drawn first are kept.
        five = some[np.argsort(-tac[some], kind="stable")[:KEPT]]
        kept.append(truth[some].max() in truth[five])
        short.append(truth[some].max() - truth[five].max())
    low, high = np.quantile(ranks, [0.1, 0.9])
    return {
        "rank": round(float(np.mean(ranks)), 3),
        "rank_low": round(float(low), 3),
        "rank_high": round(float(high), 3),
        "best_kept": round(float(np.mean(kept)), 3),
        "shortfall": round(float(np.mean(short)), 4),
    }


def plot(rows: list[dict[str, float]], path: Path) -> None:
    """Rank and best kept by number of preferences, a line for each error."""
    figure = Figure(figsize=(8.4, 3.4), layout="constrained")
    axes = figure.subplots(1, 2)
    for error in ERRORS:
        own = [row for row in rows if row["error"] == error]
        number = [row["preferences"] for row in own]
        for axis, name in zip(axes, ("rank", "best_kept"), strict=True):
            axis.plot(
                number, [row[name] for row in own], marker="o", markersize=4, label=f"{error:.0%} errors"
            )
    for axis, title in zip(
        axes, ("Kendall's tau between TAC and truth", "truly best of ten among the five kept"), strict=True
    ):
        axis.set_xscale("log", base=2)
        axis.set_xticks(NUMBERS, [str(number) for number in NUMBERS])
        axis.set_xlabel("preferences")
        axis.set_title(title, fontsize=10)
        axis.grid(alpha=0.3)
        axis.set_ylim(0, 1)
    axes[1].axhline(KEPT / OF, color="grey", linestyle=":", linewidth=1)
    axes[1].text(NUMBERS[-1], KEPT / OF - 0.06, "chance", color="grey", fontsize=8, ha="right")
    axes[0].legend(fontsize=8, title="the judge makes", title_fontsize=8)
    with whole_file(path) as partial:
        figure.savefig(partial, format="png", dpi=130)


def main() -> None:
    """Compute and keep all figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.tac", description="Preferences that the TAC needs")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--plot", type=Path, metavar="FILE", help="figure (.png)")
    asked = parser.parse_args()
    found = figures()
    write_result(asked.json, found)
    if asked.plot:
        plot(found["rows"], asked.plot)


if __name__ == "__main__":
    main()

"""What a policy for any car makes of what the car is: Shapley values of the numbers that it is told.

`python -m benchmarks.car_facts --json FILE [CHECKPOINT]` takes the bundled generalist, or another one; it
needs the package shap. Moments of laps alone are drawn, on circuits and in cars that no training has seen. In
each the numbers of the car are explained against those of other cars (Lundberg and Lee, "A unified approach
to interpreting model predictions", 2017): by how much they move pedals and steering, with all else as it was.

`facts` has a row for each `name`, of the part of the car `group`: mean size of its value on `pedals` and
`steering`, which reach from -1 to 1; `groups` their sums. The figure is `docs/images/car-facts.png`.
"""

from __future__ import annotations

import argparse
import importlib.util
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.progress import track

from benchmarks.generalist import HELD_OUT, unseen
from benchmarks.result import write_result
from nathlon.policies.bundled import generalist
from nathlon.policies.checkpoint import NetworkPolicy, load_checkpoint
from nathlon.policies.mlp import EncodedMlp
from nathlon.sim.car import load_car
from nathlon.sim.car_facts import FACTS
from nathlon.sim.car_family import generate_car, write_car
from nathlon.sim.clock import AGENT_DT
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.world import World

FIGURE = Path(__file__).parent.parent / "docs" / "images" / "car-facts.png"
MOMENTS, OTHERS, SHOWN = 120, 24, 16
"""Moments explained, cars that each is compared with, and bars of the figure."""
LAP_S, EVERY_S = 60.0, 2.5
"""Driven in each car, and between two moments that may be drawn."""
SEED = 20
FIRST = np.zeros(1, np.int64)
GROUPS = {
    "drivetrain": ("drive_", "differential", "traction_slip", "engine_braking"),
    "brakes": ("brake", "abs_slip"),
    "tyres and road": ("grip_", "peak_slip_", "wear_rate", "kerb_grip", "grass_grip", "gravel_grip"),
    "air": ("drag", "downforce"),
    "steering": ("full_lock", "steering_rate"),
    "mass and size": ("",),
}
"""Parts of a car, by what the names of their numbers begin with; the first that fits."""
COLOURS = ("#2a6f97", "#c1666b", "#4a7c59", "#8d6a9f", "#d4a373", "#6c757d")

Array = NDArray[np.float32]


def group_of(name: str) -> str:
    """The part of the car that a number belongs to."""
    return next(group for group, heads in GROUPS.items() if name.startswith(heads))


def at_start(circuit: str, car: str, rng: np.random.Generator) -> World:
    """One car about to drive a time trial."""
    scenario, place = load_scenario("time_trial"), load_track(circuit)
    world = scenario.world(place, load_car(car), 1)
    world.reset(0, scenario.place(place, rng))
    return world


def moments(policy: NetworkPolicy, found: list[tuple[str, str]], rng: np.random.Generator) -> Array:
    """What the policy sees in laps alone, (MOMENTS, size): some of every circuit and car."""
    seen = []
    every = round(EVERY_S / AGENT_DT)
    for circuit, car in track(found, "Laps"):
        world, memory = at_start(circuit, car, rng), policy.initial_memory(1)
        for step in range(round(LAP_S / AGENT_DT)):
            looks = world.observe(policy.observation_spec, FIRST, FIRST)
            actions, memory = policy.act(looks, memory)
            if step % every == every - 1 and world.state["driving"][0, 0]:
                seen.append(looks[0].copy())
            world.step(actions[:, None])
    return np.stack(seen)[rng.choice(len(seen), min(MOMENTS, len(seen)), replace=False)]


def shapley(network: EncodedMlp, seen: Array, others: Array, seed: int) -> NDArray[np.float64]:
    """Values of the facts of each moment, (moments, facts, 2), against the facts of other cars."""
    import shap

    values = []
    for looks in track(seen, "Values"):
        rest, facts = looks[: -network.facts], looks[-network.facts :]

        def act(given: NDArray[Any], rest: Array = rest) -> Array:
            encoded = network.encoder(np.ascontiguousarray(given, np.float32))
            return network.network(np.concatenate([np.tile(rest, (len(given), 1)), encoded], axis=1))

        explain = shap.PermutationExplainer(act, shap.maskers.Independent(others, len(others)), seed=seed)
        values.append(explain(facts[None], max_evals=2 * network.facts + 1, silent=True).values[0])
    return np.stack(values)


def draw(rows: pl.DataFrame, path: Path) -> None:
    """The figure: the numbers that matter most."""
    shown = rows.head(SHOWN).reverse()
    figure = Figure(figsize=(9.0, 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 2, sharey=True)
    colours = dict(zip(GROUPS, COLOURS, strict=True))
    for each, axis in zip(("pedals", "steering"), axes, strict=True):
        axis.barh(
            shown["name"].str.replace_all("_", " "),
            shown[each],
            color=[colours[group] for group in shown["group"]],
        )
        axis.locator_params(axis="x", nbins=5)
        axis.set_xlabel(f"mean size of the value on {each}")
        axis.spines[["top", "right"]].set_visible(False)
    handles = [axes[0].barh([0], [0], color=colour) for colour in colours.values()]
    axes[1].legend(handles, list(colours), loc="lower right", frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def measure(checkpoint: Path) -> pl.DataFrame:
    """A row for each number, those that matter most to the pedals first."""
    policy = load_checkpoint(checkpoint)
    if not isinstance(policy.network, EncodedMlp):
        raise InputError(f"{checkpoint}: has no encoder, expected a policy for any car")
    rng = np.random.default_rng(SEED)
    with tempfile.TemporaryDirectory() as folder:
        found = [pair[1:] for pair in unseen(Path(folder), None, 20)]
        seen = moments(policy, found, rng)
        others = []
        for place in range(OTHERS):
            path = Path(folder) / f"other-{place}.toml"
            write_car(path, generate_car(HELD_OUT + 1000 + place))
            looks = at_start("lindenring", str(path), rng).observe(policy.observation_spec, FIRST, FIRST)
            others.append(looks[0, -policy.network.facts :])
    values = np.abs(shapley(policy.network, seen, np.stack(others), SEED)).mean(axis=0)
    return pl.DataFrame(
        {
            "name": [name for name, _, _ in FACTS],
            "group": [group_of(name) for name, _, _ in FACTS],
            "pedals": values[:, 0].round(5),
            "steering": values[:, 1].round(5),
        }
    ).sort("pedals", descending=True)


def main() -> None:
    """Measure, draw, and write the JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.car_facts", description="What a car's numbers matter")
    parser.add_argument("checkpoint", nargs="?", type=Path, help="default: the bundled one")
    parser.add_argument("--json", type=Path, required=True, help="file for the figures")
    chosen = parser.parse_args()
    if importlib.util.find_spec("shap") is None:
        parser.error("the package shap is missing: pip install shap")
    checkpoint = chosen.checkpoint or generalist()
    try:
        rows = measure(checkpoint)
    except InputError as error:
        parser.error(str(error))
    draw(rows, FIGURE)
    groups = rows.group_by("group").agg(pl.col("pedals", "steering").sum().round(4))
    figures = {
        "checkpoint": checkpoint.stem,
        "moments": MOMENTS,
        "groups": groups.sort("pedals", descending=True).to_dicts(),
        "facts": rows.to_dicts(),
    }
    write_result(chosen.json, figures)


if __name__ == "__main__":
    main()

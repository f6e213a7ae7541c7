"""A short selection in simulators that others wrote, by the mappings of the examples."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.command_line import nathlon

FOLDER = Path(__file__).parent.parent.parent / "examples" / "worlds"
FEW = """
[pareto]
races = 1
most_races = 2
keep_probability = 0.0

[battery]
runs = 2

[committee]
shortlist = 2

[tournament]
pairs = 2
"""


def save_policies(folder: Path, name: str) -> None:
    """Three that have learnt nothing: what is tested is that they can be played and told apart."""
    # Here, as both test processes collect this module, and one runs it: simulators load for seconds.
    from stable_baselines3 import PPO

    from examples.worlds import circuit, four, tag
    from examples.worlds.train import OneSeat

    makers = {
        "four": (four.Four, four.Four.possible_agents),
        "tag": (tag.tag, tag.CHASERS),
        "circuit": (circuit.Circuit, ("car_0",)),
    }
    make, seats = makers[name]
    for seed in range(3):
        environment = OneSeat(make(), tuple(seats), seed)
        PPO("MlpPolicy", environment, seed=seed, device="cpu").save(folder / f"seed-{seed}.zip")


@pytest.mark.parametrize("name", ["four", "tag", "circuit"])
def test_a_selection_runs_from_the_filter_to_the_report(tmp_path: Path, name: str) -> None:
    policies, config = tmp_path / "policies", tmp_path / "nathlon.toml"
    policies.mkdir()
    save_policies(policies, name)
    config.write_text(FEW)
    done = nathlon(
        *("evaluate", policies, "--world", f"{FOLDER / name}.py:world", "--config", config),
        *("--out", tmp_path / "out"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    stages = {stage["name"]: stage for stage in summary["stages"]}
    assert stages["pareto"]["in"] == 3
    assert stages["battery"]["races"] > 0
    # Chasers meet nobody but the background.
    assert list(summary["stages_set_aside"]) == (["tournament"] if name == "tag" else [])
    assert ("tournament" in stages and stages["tournament"]["races"] > 0) == (name != "tag")
    [sent] = summary["sent"]
    assert sent["name"] in {"seed-0", "seed-1", "seed-2"}
    assert (summary["faults"], summary["void"]) == (0, 0)
    assert (tmp_path / "out" / "report" / "index.html").stat().st_size > 1000

"""What `import nathlon` offers: the page's examples run as they stand, and results tell what they hold."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import polars as pl
import pytest

import nathlon
from nathlon.api.candidates import named_sources
from nathlon.api.selection import SelectionResult
from nathlon.sim.errors import InputError
from tests.support.trainings import CHECKPOINTS, TOML

PAGE = Path(__file__).parent.parent.parent / "docs" / "python.md"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the page's blocks leave, run one after the other as in a notebook."""
    folder = tmp_path_factory.mktemp("notebook")
    (folder / "quick.toml").write_text(TOML)
    names: dict[str, Any] = {"__name__": "notebook", "folder": folder}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL):
            exec(compile(block, PAGE.name, "exec"), names)
    return names


def test_a_selection_is_an_object_with_its_tables(made: dict[str, Any]) -> None:
    result = made["result"]
    assert isinstance(result, SelectionResult)
    assert result.pareto.height == 3
    for table in (result.pareto, result.battery, result.skills, result.ranking):
        assert table.columns[:2] == ["name", "entrant"]
        assert table["name"].null_count() == 0
    assert set(result.sent) <= set(result.ranking["name"])
    assert set(result.matchups["opponent_name"]) <= set(result.ranking["name"])
    assert result.verdict.headline in repr(result)
    for path in (result.report, result.spreadsheet, result.store):
        assert (made["folder"] / path).exists()


def test_a_notebook_sees_the_verdict_a_picture_and_the_ranking(made: dict[str, Any]) -> None:
    html = made["result"]._repr_html_()
    assert html.startswith(f"<h3>{made['result'].verdict.headline}</h3>")
    assert "data:image/png;base64,iVBOR" in html
    for name in made["result"].ranking["name"]:
        assert name in html


def test_a_race_tells_its_order_and_keeps_its_recording(made: dict[str, Any]) -> None:
    results = made["race"].results
    assert results["place"].to_list() == list(range(1, results.height + 1))
    assert set(results["name"]) == {"driver", "driver:pace=0.95"}
    assert repr(made["race"]).splitlines()[0].startswith("  1 ")
    assert (made["folder"] / made["race"].recording).stat().st_size > 1000
    assert "<table" in made["race"]._repr_html_()


def test_training_leaves_checkpoints_and_a_curve(made: dict[str, Any]) -> None:
    run = made["run"]
    assert len(run.checkpoints) == len(CHECKPOINTS)
    assert run.curve["updates"].to_list() == list(CHECKPOINTS)
    assert isinstance(run.curve, pl.DataFrame)


def test_environments_are_made(made: dict[str, Any]) -> None:
    assert len(made["env"].possible_agents) == 8
    assert made["many"].num_envs == 8


def test_an_undecided_selection_says_so(tmp_path: Path) -> None:
    result = SelectionResult(tmp_path, None)
    assert "waits for its members" in repr(result)
    with pytest.raises(InputError, match="undecided"):
        _ = result.ranking


def test_what_is_no_policy_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.zip: no such file"):
        named_sources("nowhere.zip")
    with pytest.raises(InputError, match="field observation_spec is missing"):
        named_sources([3])  # type: ignore[list-item]
    with pytest.raises(AttributeError, match="no attribute 'chose'"):
        _ = nathlon.chose


@pytest.mark.parametrize("order", ["import nathlon, gymnasium", "import gymnasium, nathlon"])
def test_gymnasium_knows_the_environments_whichever_is_imported_first(order: str) -> None:
    script = f"{order}\nprint(gymnasium.spec('nathlon/Race-v0').id)"
    assert subprocess.check_output([sys.executable, "-c", script], text=True).split() == ["nathlon/Race-v0"]


LOADING = """
import sys, nathlon
print(*sys.modules)

from contextlib import redirect_stdout
from os import devnull
with open(devnull, "w") as nowhere, redirect_stdout(nowhere):
    from nathlon.cli import app
    app(["--help"], standalone_mode=False)
print(*sys.modules)

import nathlon.policies.apart_host
print(*sys.modules)

import nathlon.commands.racing, nathlon.api.race
print(*sys.modules)

import nathlon.policies.preloaded
from nathlon.arena.job import Opening
from nathlon.arena.serving import do
from nathlon.arena.watch import Watch
from nathlon.policies.load import load_policy
list(do([Opening("driver", load_policy, ("driver", "lindenring", "gt3"))], Watch()))
print(*sys.modules)
"""
"""Prints what is loaded once the package is imported, for help, a guest, a race, and in a worker."""


def test_everything_is_loaded_where_it_is_used() -> None:
    printed = subprocess.check_output([sys.executable, "-c", LOADING], text=True).splitlines()
    package, command_line, guest, race, worker = (set(line.split()) for line in printed)
    assert not {"typing", "importlib.abc", "importlib.resources", "typer"} & package
    assert not {"numpy", "numba", "torch", "polars", "pydantic", "gymnasium"} & command_line
    assert not {"scipy.interpolate", "scipy.spatial", "scipy.ndimage", "scipy.sparse", "polars"} & guest
    unused = {"torch", "ray", "matplotlib", "rerun", "tensorboard", "sqlalchemy", "jinja2", "xlsxwriter"}
    assert not unused & race
    assert not unused & worker

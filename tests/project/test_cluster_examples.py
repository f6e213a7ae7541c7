"""The examples for clusters: their files can be read, and what they call is there with these options."""

from __future__ import annotations

import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

from nathlon.cli import app

FOLDER = Path(__file__).parent.parent.parent / "examples" / "cluster"
SCRIPTS = sorted(FOLDER.glob("*.sh"))
JOB = yaml.safe_load((FOLDER / "kubernetes.yaml").read_text("utf-8"))


def accepted(arguments: list[str]) -> dict[str, Any]:
    """What the command line makes of `nathlon` and its arguments; it raises a usage error where it cannot."""
    program, command, *rest = arguments
    assert program == "nathlon"
    found: Any = typer.main.get_command(app)
    parsed: dict[str, Any] = found.commands[command].make_context(command, rest).params
    return parsed


def called(script: Path) -> list[str]:
    """The call of nathlon in a script, with values instead of what the shell puts in."""
    [line] = re.findall(r"nathlon worker .*", script.read_text("utf-8").partition("set -eu")[2])
    line = re.sub(r'"\$\(.*?\)"|"\$store"', "store.sqlite", line.partition("<")[0])
    return shlex.split(re.sub(r'"\$SLURM_\w+"', "16", line))


def test_there_is_a_script_for_slurm_and_for_ssh() -> None:
    assert [script.name for script in SCRIPTS] == ["slurm.sh", "ssh.sh"]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name)
def test_a_script_can_be_read_by_the_shell(script: Path) -> None:
    subprocess.run(["bash", "-n", script], check=True)
    assert accepted(called(script))["store"] == "store.sqlite"


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name)
def test_a_script_without_a_store_says_so_and_starts_nothing(script: Path) -> None:
    done = subprocess.run(["bash", script], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "the URL of the store" in done.stderr


def test_the_array_has_its_options_before_its_commands() -> None:
    """Slurm reads no `#SBATCH` line after the first command."""
    text = (FOLDER / "slurm.sh").read_text("utf-8")
    options = dict(re.findall(r"^#SBATCH --([\w-]+)=(\S+)$", text, re.MULTILINE))
    assert {"array", "cpus-per-task", "time"} <= options.keys()
    assert "#SBATCH" not in text.partition("set -eu")[2]


def test_the_job_is_an_indexed_one_whose_parts_fit_together() -> None:
    spec = JOB["spec"]
    assert (JOB["apiVersion"], JOB["kind"], spec["completionMode"]) == ("batch/v1", "Job", "Indexed")
    assert spec["completions"] == spec["parallelism"]
    pod = spec["template"]["spec"]
    assert pod["restartPolicy"] == "Never", "which a limit for each index needs"
    [container] = pod["containers"]
    assert all(isinstance(argument, str) for argument in container["args"])
    given = accepted(container["args"])
    assert given["store"].startswith("postgresql+psycopg://")
    assert str(given["workers"]) == container["resources"]["requests"]["cpu"]
    mounts = {mount["name"]: mount["mountPath"] for mount in container["volumeMounts"]}
    assert mounts.keys() == {volume["name"] for volume in pod["volumes"]}
    values = {entry["name"]: entry.get("value") for entry in container["env"]}
    assert values["XDG_CACHE_HOME"] in mounts.values()
    assert all(isinstance(value, str) for value in values.values() if value is not None)

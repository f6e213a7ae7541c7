"""The examples for clusters: their files can be read, and what they call is there with these options."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

from nathlon.cli import app

FOLDER = Path(__file__).parent.parent.parent / "examples" / "cluster"
SCRIPTS = sorted(FOLDER.glob("*.sh"))
ROOT = FOLDER.parent.parent
JOB = yaml.safe_load((FOLDER / "kubernetes.yaml").read_text("utf-8"))
COMPOSE = yaml.safe_load((FOLDER / "compose.yaml").read_text("utf-8"))


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
    given = accepted([*container["command"], *container["args"]])
    assert given["store"].startswith("postgresql+psycopg://")
    assert str(given["workers"]) == container["resources"]["requests"]["cpu"]
    mounts = {mount["name"]: mount["mountPath"] for mount in container["volumeMounts"]}
    assert mounts.keys() == {volume["name"] for volume in pod["volumes"]}
    values = {entry["name"]: entry.get("value") for entry in container["env"]}
    assert values["XDG_CACHE_HOME"] in mounts.values()
    assert all(isinstance(value, str) for value in values.values() if value is not None)


def test_the_job_is_what_the_restricted_pod_security_standard_accepts() -> None:
    """https://kubernetes.io/docs/concepts/security/pod-security-standards/."""
    pod = JOB["spec"]["template"]["spec"]
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["securityContext"]["runAsUser"] > 0
    assert pod["securityContext"]["seccompProfile"]["type"] in ("RuntimeDefault", "Localhost")
    assert not pod.keys() & {"hostNetwork", "hostPID", "hostIPC", "initContainers"}
    kinds = {"configMap", "csi", "downwardAPI", "emptyDir", "ephemeral", "persistentVolumeClaim", "secret"}
    assert all(volume.keys() - {"name"} <= kinds for volume in pod["volumes"])
    for container in pod["containers"]:
        context = container["securityContext"]
        assert context["allowPrivilegeEscalation"] is False
        assert context["capabilities"] == {"drop": ["ALL"]}
        assert not context.get("privileged")
        assert not any("hostPort" in port for port in container.get("ports", ()))


def test_the_job_keeps_to_the_schema_of_kubernetes() -> None:
    validation = pytest.importorskip("kubernetes_validate")
    validation.validate(JOB, validation.latest_version(), strict=True)


def test_the_dockerfile_has_no_fault_that_a_linter_knows() -> None:
    hadolint = shutil.which("hadolint", path=str(Path(sys.executable).parent))
    if hadolint is None:
        pytest.skip("needs the extra dev, on Linux")
    done = subprocess.run([hadolint, ROOT / "Dockerfile"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")


def test_the_image_runs_as_nobody_and_has_all_that_a_build_needs() -> None:
    lines = (ROOT / "Dockerfile").read_text("utf-8").splitlines()
    assert "USER 10001:10001" in lines
    assert JOB["spec"]["template"]["spec"]["securityContext"]["runAsUser"] == 10001
    sent = {line[1:] for line in (ROOT / ".dockerignore").read_text("utf-8").splitlines() if line[:1] == "!"}
    rooms = {link.name for link in (ROOT / "nathlon").iterdir() if link.is_symlink()}
    assert rooms | {"nathlon", "pyproject.toml", "README.md", "LICENSE", "requirements*.lock"} == sent


def test_compose_runs_a_store_a_room_and_two_workers() -> None:
    services = COMPOSE["services"]
    text = (FOLDER / "compose.yaml").read_text("utf-8")
    values = dict(re.findall(r"^(\w+)=(.*)$", (FOLDER / ".env.example").read_text("utf-8"), re.MULTILINE))
    assert set(re.findall(r"\$\{(\w+)", text)) == values.keys()
    assert services.keys() == {"store", "worker", "room", "night"}
    assert services["worker"]["deploy"]["replicas"] == 2
    for name in ("worker", "room", "night"):
        service = services[name]
        written = service["command"]
        text = written if isinstance(written, str) else shlex.join(written)
        # As Compose does: values come first, a text is split into words then.
        command = shlex.split(re.sub(r"\$\{(\w+)[^}]*\}", lambda found: values[found[1]], text))
        given = accepted(["nathlon", *command])
        assert given.get("store", "postgresql+psycopg://").startswith("postgresql+psycopg://")
        assert given.get("member", ["ann", "bob"]) == ["ann", "bob"]
        assert service["read_only"]
        assert service["cap_drop"] == ["ALL"]
        assert service["depends_on"]["store"]["condition"] == "service_healthy"
        targets = {volume.split(":")[1] for volume in service["volumes"]}
        assert "/cache" in targets
    assert "ports" not in services["store"], "the store is for the others only"
    named = {volume.split(":")[0] for one in services.values() for volume in one["volumes"]}
    assert {name for name in named if not name.startswith(".")} == COMPOSE["volumes"].keys()

"""What is installed: the wheel, in a project that has packages of the rooms' names itself."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest

pytestmark = pytest.mark.takes_long

ROOT = Path(__file__).parent.parent.parent
ROOMS = ("sim", "policies", "arena", "tournament", "reports")

# It does not step, as that would compile all kernels for where they are installed.
MAKING = """
import gymnasium
import nathlon
import policies, sim, arena, tournament, reports
from policies.mine import gain

env = gymnasium.make("nathlon/TimeTrial-v0")
action = gain * env.action_space.sample()
print(nathlon.__file__, policies.__file__, env.action_space.contains(action))
"""

TESTED = """
import nathlon
from policies.mine import gain
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.load import load_file
from sim import OWN


def test_a_bundled_checkpoint() -> None:
    assert "{site}" in nathlon.__file__
    for path in sorted(BUNDLED.glob("*/*.safetensors")):
        assert load_file(path).card.circuit in (path.parent.name, "any") or path.parent.name == "sight"
    assert OWN and gain
"""


LIBRARIES = ("purelib", "platlib")


class Project(NamedTuple):
    """Someone's project, and the folder into which the wheel is installed."""

    folder: Path
    site: Path

    @property
    def environment(self) -> dict[str, str]:
        """Has Python find the wheel, and the libraries; with -S, the editable installation is not found."""
        path = os.pathsep.join([str(self.site), *dict.fromkeys(sysconfig.get_paths()[p] for p in LIBRARIES)])
        return os.environ | {"PYTHONPATH": path}

    def python(self, *arguments: str) -> str:
        """What Python prints, started in the project."""
        done = subprocess.run(
            [sys.executable, "-S", *arguments],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout


def build(target: str, folder: Path, source: Path = ROOT) -> Path:
    """Build a distribution, offline."""
    command = [sys.executable, "-m", "hatchling", "build", "--target", target, "--directory", str(folder)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    (made,) = folder.iterdir()
    return made


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def project(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Project:
    made = Project(tmp_path_factory.mktemp("project"), tmp_path_factory.mktemp("site"))
    for room in ROOMS:
        (made.folder / room).mkdir()
        (made.folder / room / "__init__.py").write_text("OWN = True\n")
    (made.folder / "policies" / "mine.py").write_text("gain = 0.5\n")
    install = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", str(made.site)]
    subprocess.run([sys.executable, *install, str(wheel)], check=True)
    return made


def test_the_wheel_holds_nathlon_and_each_file_once(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"nathlon"}
    assert sorted(set(names)) == sorted(names)
    tracked = subprocess.run(["git", "ls-files", *ROOMS, "nathlon"], cwd=ROOT, capture_output=True, text=True)
    if tracked.returncode == 0:
        files = {name for name in tracked.stdout.splitlines() if (ROOT / name).is_file()}
        inside = {name if name.startswith("nathlon/") else f"nathlon/{name}" for name in files}
        assert inside == {name for name in names if name.startswith("nathlon/")}
    for name in (
        "nathlon/py.typed",
        "nathlon/data/nathlon.toml",
        "nathlon/arena/migrations/versions/v0002_many_runs.py",
        "nathlon/policies/bundled/README.md",
        "nathlon/reports/templates/page.css",
        "nathlon/sim/data/circuits/lindenring/centre_line.csv",
    ):
        assert name in names


def test_the_source_distribution_makes_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    source = build("sdist", tmp_path / "dist")
    shutil.unpack_archive(source, tmp_path)
    again = build("wheel", tmp_path / "again", tmp_path / source.name.removesuffix(".tar.gz"))
    assert again.read_bytes() == wheel.read_bytes()


def test_a_script_makes_an_environment_beside_packages_of_the_same_names(project: Project) -> None:
    (project.folder / "make.py").write_text(MAKING)
    ours, theirs, fits = project.python("make.py").split()
    assert Path(ours).is_relative_to(project.site)
    assert Path(theirs).is_relative_to(project.folder)
    assert fits == "True"


def test_pytest_runs_beside_packages_of_the_same_names(project: Project) -> None:
    (project.folder / "test_mine.py").write_text(TESTED.replace("{site}", str(project.site)))
    assert "1 passed" in project.python("-m", "pytest", "-p", "no:cacheprovider", "test_mine.py")


def test_a_notebook_runs_beside_packages_of_the_same_names(
    project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    import nbformat  # takes a second, which all test processes would wait for
    from nbclient import NotebookClient

    spec = project.folder / "kernels" / "wheel"
    spec.mkdir(parents=True)
    command = [sys.executable, "-S", "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    (spec / "kernel.json").write_text(json.dumps({"argv": command, "display_name": "", "language": "python"}))
    monkeypatch.setenv("JUPYTER_PATH", str(project.folder))
    monkeypatch.setenv("PYTHONPATH", project.environment["PYTHONPATH"])
    cells = [
        nbformat.v4.new_code_cell(
            "import nathlon, policies, sim\nfrom nathlon.sim.observation import ObservationSpec"
        ),
        nbformat.v4.new_code_cell(
            "print(nathlon.__file__, ObservationSpec(course_points=1).size > 0, sim.OWN)"
        ),
    ]
    notebook = nbformat.v4.new_notebook(cells=cells)
    NotebookClient(
        notebook, kernel_name="wheel", resources={"metadata": {"path": str(project.folder)}}
    ).execute()
    (output,) = notebook.cells[1].outputs
    ours, *rest = output.text.split()
    assert Path(ours).is_relative_to(project.site)
    assert rest == ["True", "True"]

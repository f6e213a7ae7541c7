"""The list of files that decide a result."""

from __future__ import annotations

import ast
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from nathlon.sim.decisive import DECISIVE, PACKAGE, files, fingerprint

CARRIERS = {
    "arena/entrant.py",  # gives ids, which are in the key
    "arena/worlds/__init__.py",
    "arena/world.py",
    "arena/world_finding.py",
    "arena/world_registry.py",
    "policies/__init__.py",
    "policies/bundled/__init__.py",  # a path
    "sim/__init__.py",
    "sim/decisive.py",
    "sim/errors.py",
    "sim/extras.py",
    "sim/names.py",
    "sim/process.py",
    "sim/untrusted_file.py",
    "sim/validation.py",
    "sim/whole_file.py",
}
"""What decisive modules import that only carries text and files."""

ROOTS = {"arena/match_policies.py", "arena/runner.py", "policies/load.py"}
"""What others call to have a race run."""

KERNELS = "sim/kernel.py"


def place(module: str) -> str | None:
    """Of a module in the package; None if it is none of ours."""
    path = PACKAGE.joinpath(*module.split(".")[1:])
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if module.startswith("nathlon.") and file.is_file():
            return file.relative_to(PACKAGE).as_posix()
    return None


def imported(path: Path) -> Iterator[str]:
    """Places of our modules that a module imports, but for its types alone."""
    waiting: list[ast.AST] = [ast.parse(path.read_text("utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            yield from filter(None, (place(alias.name) for alias in node.names))
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                found = place(f"{node.module}.{alias.name}") or place(node.module)
                if found:
                    yield found


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the rooms."""
    for room in ("sim", "policies", "arena"):
        shutil.copytree(
            PACKAGE / room, tmp_path / room, ignore=shutil.ignore_patterns("bundled", "__pycache__")
        )
    return tmp_path


def edited(package: Path, name: str) -> str:
    """The fingerprint after a file has got another line."""
    path = package / name
    before = path.read_bytes()
    path.write_bytes(before + b"# edited\n")
    fingerprint.cache_clear()
    found = fingerprint(package)
    path.write_bytes(before)
    fingerprint.cache_clear()
    return found


@pytest.mark.parametrize("name", DECISIVE)
def test_all_that_is_listed_exists(name: str) -> None:
    assert (PACKAGE / name).exists()


def test_a_copy_of_the_package_has_its_fingerprint(package: Path) -> None:
    assert fingerprint(package) == fingerprint()


@pytest.mark.parametrize(
    "name",
    [
        "sim/physics/tyre.py",
        "sim/data/cars/gt3.toml",
        "sim/data/circuits/lindenring/centre_line.csv",
        "policies/sources/onnx.py",
        "policies/driver/practice.py",
        "arena/runner.py",
    ],
)
def test_a_decisive_file_changes_the_fingerprint(package: Path, name: str) -> None:
    assert edited(package, name) != fingerprint(package)


@pytest.mark.parametrize(
    "name",
    [
        "sim/render/scene.py",
        "sim/track/map.py",
        "policies/training/log.py",
        "policies/environments/race_gym_env.py",
        "arena/pool.py",
    ],
)
def test_another_file_does_not(package: Path, name: str) -> None:
    assert edited(package, name) == fingerprint(package)


def test_a_new_file_in_a_decisive_folder_changes_the_fingerprint(package: Path) -> None:
    before = fingerprint(package)
    (package / "sim/data/cars/another.toml").write_text("")
    fingerprint.cache_clear()
    assert fingerprint(package) != before


def test_a_listed_file_that_is_missing_is_no_fingerprint(package: Path) -> None:
    (package / "arena/team.py").unlink()
    fingerprint.cache_clear()
    with pytest.raises(FileNotFoundError, match="team"):
        fingerprint(package)


def test_what_decisive_modules_import_is_decisive() -> None:
    listed = {path.relative_to(PACKAGE).as_posix() for path in files()}
    needed = {name for path in files() if path.suffix == ".py" for name in imported(path)}
    assert needed - listed - CARRIERS == set()
    assert CARRIERS & listed == set()


def test_files_that_are_listed_by_themselves_are_needed() -> None:
    needed = {
        name
        for path in files()
        if path.suffix == ".py"
        for name in imported(path)
        if name != path.relative_to(PACKAGE).as_posix()
    }
    alone = {name for name in DECISIVE if name.endswith(".py")}
    assert alone - needed == ROOTS


def test_every_module_with_kernels_is_decisive() -> None:
    listed = set(files())
    with_kernels = {
        path
        for room in ("sim", "policies", "arena", "tournament", "reports")
        for path in (PACKAGE / room).rglob("*.py")
        if KERNELS in imported(path)
    }
    assert len(with_kernels) > 10
    assert with_kernels - listed == set()

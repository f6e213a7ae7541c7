"""Every module has one name, below `nathlon`, wherever Python was started."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
ROOMS = ("sim", "policies", "arena", "tournament", "reports")

EVERYTHING = """
import importlib, pkgutil, sys
from collections import Counter
from pathlib import Path
import nathlon

def failed(name):
    raise

for module in pkgutil.walk_packages(nathlon.__path__, "nathlon.", failed):
    if ".migrations." not in module.name:  # those run when they are loaded
        importlib.import_module(module.name)
files = Counter(
    Path(file).resolve()
    for module in list(sys.modules.values())
    if (file := getattr(module, "__file__", None)) and getattr(module, "__spec__", None)
)
own = [Path.cwd() / room for room in ("nathlon", *sys.argv[1:])]
ours = {file: count for file, count in files.items() if any(map(file.is_relative_to, own))}
print(len(ours), [str(file) for file, count in ours.items() if count > 1])
print(sorted({name.partition(".")[0] for name in sys.modules} & set(sys.argv[1:])))
"""


def run(*arguments: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Python, started in a folder."""
    return subprocess.run([sys.executable, *arguments], cwd=cwd, capture_output=True, text=True)


def test_no_module_is_loaded_under_two_names() -> None:
    """In the root of the checkout, where the rooms lie on the path too."""
    done = run("-c", EVERYTHING, *ROOMS)
    assert done.returncode == 0, done.stderr
    loaded, names = done.stdout.splitlines()
    count, _, twice = loaded.partition(" ")
    assert int(count) > 150
    assert twice == "[]"
    assert names == "[]"


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_alone_is_refused_by_the_name_that_it_has(room: str) -> None:
    done = run("-c", f"import {room}")
    assert done.stderr.splitlines()[-1] == f"ModuleNotFoundError: import nathlon.{room} instead of {room}"


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_is_a_folder_at_the_top_and_a_link(room: str) -> None:
    if not (ROOT / room).is_dir():
        pytest.skip("a source distribution has the rooms in nathlon/ only")
    assert not (ROOT / room).is_symlink()
    assert (ROOT / "nathlon" / room).readlink() == Path("..") / room


def test_a_clone_without_links_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "nathlon.policies.registration")
    monkeypatch.setitem(sys.modules, "nathlon.policies", None)
    with pytest.raises(ImportError, match=r"core\.symlinks=true"):
        runpy.run_path(str(ROOT / "nathlon" / "__init__.py"))

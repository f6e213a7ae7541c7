"""What a bare installation can do, and what it says of the rest."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from nathlon.sim.data_file import DATA
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from tests.support.checkpoints import BUNDLED

ABSENT = (
    "torch",
    "tensorboard",
    "stable_baselines3",
    "psycopg",
    "av",
    "uvicorn",
    "ray",
    "casadi",
    "wandb",
    "mlflow",
    "fsspec",
)
WITHOUT = f"import sys; sys.modules.update(dict.fromkeys({ABSENT}))\n"


def bare(code: str) -> subprocess.CompletedProcess[str]:
    """Run code where nothing of any extra can be imported."""
    return subprocess.run([sys.executable, "-c", WITHOUT + code], capture_output=True, text=True)


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    return bare(f"sys.argv[1:] = {arguments!r}\nfrom nathlon.cli import main\nmain()")


def test_what_is_there_is_not_asked_for() -> None:
    need("numpy", "train", "training")


def test_what_is_not_there_is_named_with_its_extra() -> None:
    with pytest.raises(
        InputError, match=r"^a race needs no_such, which the extra sb3 installs: pip install -e '\.\[sb3\]'"
    ):
        need("no_such", "sb3", "a race")


def test_a_selection_and_the_environments_do_without() -> None:
    """Each of these modules loads all that its commands need."""
    code = """
import gymnasium, nathlon
import nathlon.commands.selection, nathlon.commands.nightly, nathlon.commands.replay, nathlon.commands.racing
import nathlon.commands.export, nathlon.commands.track, nathlon.commands.committee, nathlon.commands.battery
gymnasium.make("nathlon/TimeTrial-v0")
from nathlon.results.summary import versions
print(sorted(versions()))
"""
    done = bare(code)
    assert done.stdout == "['nathlon', 'numba', 'numpy', 'python']\n", done.stderr


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["train"], "training"),
        (["polish", str(BUNDLED[0])], "polishing"),
        (["ablate", "racing"], "an ablation"),
    ],
)
def test_training_says_what_to_install(arguments: list[str], what: str, tmp_path: Path) -> None:
    done = command(*arguments, "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert done.stderr.startswith(f"nathlon: {what} needs torch, which the extra train installs: ")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_zip_of_stable_baselines_says_what_to_install(tmp_path: Path) -> None:
    path = tmp_path / "sac.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", "{}")
        archive.writestr("policy.pth", b"")
    done = bare(
        "from nathlon.policies.load import load_file\nfrom pathlib import Path\n"
        f"load_file(Path({str(path)!r}))"
    )
    assert f"{path}: a .zip of Stable-Baselines3 needs torch, which the extra sb3 installs" in done.stderr


def test_a_test_drive_says_what_to_install(tmp_path: Path) -> None:
    done = command("drive", "driver", "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert done.stderr.startswith("nathlon: a test drive needs uvicorn, which the extra drive installs: ")
    assert not (tmp_path / "out").exists()


def test_the_committees_room_says_what_to_install(tmp_path: Path) -> None:
    done = command("serve", str(tmp_path / "store.sqlite"))
    assert done.returncode == 2
    assert done.stderr.startswith(
        "nathlon: the committee's room needs uvicorn, which the extra drive installs: "
    )


def test_the_limit_of_another_car_says_what_to_install(tmp_path: Path) -> None:
    text = (DATA / "cars" / "gt3.toml").read_text("utf-8")
    (tmp_path / "car.toml").write_text(text.replace("mass_kg = 1370.0", "mass_kg = 1380.0"), "utf-8")
    done = command("track", "limit", "lindenring", "--car", str(tmp_path / "car.toml"))
    assert done.returncode == 2
    assert "the fastest lap by optimal control needs casadi, which the extra limit installs" in done.stderr
    assert '"limit_s": 103.287' in command("track", "limit", "lindenring", "--json").stdout


def test_a_driver_of_the_database_is_asked_for() -> None:
    done = bare("from nathlon.arena.store import Store\nStore('postgresql+psycopg://me@localhost/there')")
    assert "PostgreSQL needs psycopg, which the extra postgres installs" in done.stderr


def test_a_cluster_asks_for_ray() -> None:
    done = bare("from nathlon.arena.on_ray.cluster import joined\nwith joined('auto'): pass")
    assert "engine 'ray' needs ray, which the extra ray installs" in done.stderr

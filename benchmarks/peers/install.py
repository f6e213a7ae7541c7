"""The peers' own environment, in the user's cache: none of them is a dependency of this project."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

FOLDER = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "nathlon" / "peers"
PYTHON = FOLDER / "venv" / "bin" / "python"
PACKAGES = ("gymnasium[box2d]==1.4.0", "highway-env==1.12.1", "numpy>=2", "gym==0.23.0", "pettingzoo==1.27.0")
"""The last two are imported by PufferLib."""
PUFFERLIB = "3.0.0"
PUFFERLIB_SOURCE = FOLDER / f"pufferlib-{PUFFERLIB}"


def install_packages() -> None:
    """A fresh virtual environment with the peers that come as wheels."""
    subprocess.run([sys.executable, "-m", "venv", "--clear", FOLDER / "venv"], check=True)
    subprocess.run([PYTHON, "-m", "pip", "install", "--quiet", *PACKAGES], check=True)


def install_pufferlib() -> None:
    """The driving environment alone out of PufferLib's source archive, compiled with PufferLib's own flags.

    The build of the whole library would fetch a lot more, which the driving environment does not need: pip,
    which runs the build's script to learn the archive's name, has the script leave out everything. The
    archive carries one map, under a name that the environment does not look for.
    """
    import numpy as np

    request = ["--no-deps", "--no-build-isolation", "--no-binary", "pufferlib", f"pufferlib=={PUFFERLIB}"]
    with TemporaryDirectory() as folder:
        # Without the environments, the script still reads this list, and does not define it.
        (Path(folder) / "sitecustomize.py").write_text("import builtins\nbuiltins.c_extension_paths = []\n")
        subprocess.run(
            [sys.executable, "-m", "pip", "download", "--quiet", "--dest", FOLDER, *request],
            env={**os.environ, "NO_OCEAN": "1", "NO_TRAIN": "1", "PYTHONPATH": folder},
            check=True,
        )
    with tarfile.open(FOLDER / f"{PUFFERLIB_SOURCE.name}.tar.gz") as archive:
        archive.extractall(FOLDER, filter="data")
    maps = PUFFERLIB_SOURCE / "resources" / "gpudrive" / "binaries"
    maps.mkdir(parents=True, exist_ok=True)
    shutil.copy(PUFFERLIB_SOURCE / "pufferlib/resources/gpudrive/map_942.bin", maps / "map_000.bin")
    raylib = PUFFERLIB_SOURCE / "raylib-5.5_linux_amd64"
    sources = PUFFERLIB_SOURCE / "pufferlib" / "ocean" / "gpudrive"
    includes = [sysconfig.get_path("include"), np.get_include(), raylib / "include"]
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O2", "-flto", "-DPLATFORM_DESKTOP", "-w", "-fwrapv"]
        + [f"-I{folder}" for folder in includes]
        + [sources / "binding.c", raylib / "lib" / "libraylib.a", "-lm", "-o", sources / "binding.so"],
        check=True,
    )


def install(console: Console) -> None:
    """Fetch every peer; what cannot be had is named in a sentence. TORCS is left to the system's packages."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, fetch in {"Python packages": install_packages, "PufferLib": install_pufferlib}.items():
        console.print(f"Fetching: {name}")
        try:
            fetch()
        except (OSError, subprocess.CalledProcessError) as error:
            console.print(f"{name} cannot be had: {error}", markup=False)
    console.print("TORCS comes with the system's packages (Debian, Ubuntu: torcs).")

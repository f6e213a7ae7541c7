"""Where a node of a cluster keeps what it compiles and practises."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from tempfile import gettempdir

CACHES = ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR")
"""Say where compiled kernels are kept."""


def keep_caches_here() -> None:
    """Keep compiled kernels on a disk of this machine, unless told where: homes may be on a network drive.

    In a folder that nobody else can write, for what is in it is run. To be called before kernels are loaded.
    """
    if any(os.environ.get(name) for name in CACHES):
        return
    folder = Path(gettempdir()) / f"nathlon-{os.getuid()}"
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    if folder.is_symlink() or found.st_uid != os.getuid() or found.st_mode & 0o077:
        return
    os.environ["XDG_CACHE_HOME"] = str(folder)

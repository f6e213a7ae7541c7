"""Files of the current folder are data: nothing that is started runs them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from nathlon.arena.on_ray.cluster import _job
from tests.support.checkpoints import BUNDLED

PROGRAM = """
import os
import sys

from nathlon.arena.job import Opening
from nathlon.arena.pool import Pool
from nathlon.policies.apart import PolicyApart
from nathlon.policies.hosting.spawned import FreshProcesses

if __name__ == "__main__":
    with Pool(1) as pool:
        print(pool.open([Opening("here", os.getenv, ("PYTHONSAFEPATH", "unset"))]))
    process = FreshProcesses().Process(target=int)
    process.start()
    process.join()
    PolicyApart(sys.argv[1], "lindenring", "gt3")
    print("done")
"""
KEPT = {"sys", "builtins", "__future__"}


def test_modules_of_the_current_folder_are_not_imported(tmp_path: Path) -> None:
    """By the processes of a pool, those of training, and those of policies apart.

    What foreign code starts from there is started as ever.
    """
    for name in ({*sys.stdlib_module_names} - KEPT) | {"numpy", "numba", "polars", "nathlon", "pydantic"}:
        (tmp_path / f"{name}.py").write_text("open('ran-' + __name__, 'w'); raise SystemExit(__name__)")
    done = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM, BUNDLED[0]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert [path.name for path in tmp_path.glob("ran-*")] == [], done.stderr
    assert done.stdout.split() == ["['unset']", "done"], done.stderr


def test_nodes_of_a_cluster_are_not_told_of_it() -> None:
    job = _job()
    job._py_driver_sys_path.append("/current/folder")  # as `ray.init` does
    assert b"/current/folder" not in job._serialize()

"""Scripts of users, as they write them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from nathlon.policies.bundled import BUNDLED

SCRIPT = """
import time
from nathlon.arena.entrance import trained_on
from nathlon.arena.pool import Pool
from nathlon.policies.training.processes import start_processes

print("begun", flush=True)
with Pool(1) as pool:
    print(*trained_on(pool, ["CHECKPOINT"]), flush=True)
with start_processes(2) as processes:
    for waiting in [processes.submit(time.sleep, 0.1) for _ in range(2)]:
        print(waiting.result())
"""


def test_processes_do_not_run_the_script_again(tmp_path: Path) -> None:
    """Though nothing in it is below `if __name__ == "__main__"`."""
    checkpoint = BUNDLED / "porto-sereno" / "porto-sereno-cup-044k.safetensors"
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.replace("CHECKPOINT", str(checkpoint)))
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True)
    assert (done.stdout, done.returncode) == ("begun\nporto-sereno coupe\nNone\nNone\n", 0), done.stderr

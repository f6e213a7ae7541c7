"""How long the demo takes: to its verdict, to its report, and to the last recording.

`python -m benchmarks.demo --json FILE` runs `nathlon demo` of this checkout with no kernel compiled yet; with
`--make`, what a newcomer types: `make demo` in a fresh clone, from the packages that pip and uv have cached.

Figures: `verdict_s`, `report_s` and `wall_s` (the end) since the start; `verdict_processor_s` that all its
processes have spent by the verdict; `load` of the machine before, a mean over a minute; `stages` of the
selection; who is `sent` with `points` a race (`points_low` to `points_high`) in `races`, and with whom it is
`tied`; `recordings_mb`; with `--make` `environment_mb`.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

from benchmarks.result import write_result
from nathlon.results.summary import Summary, read_summary

HERE = Path(__file__).parent.parent
VERDICT = "Sent "
"""What the line begins with that says who is sent."""
MB = 1e6


def main() -> None:
    """Run the demo and keep its times."""
    parser = argparse.ArgumentParser(prog="benchmarks.demo", description="How long the demo takes")
    parser.add_argument("--json", type=Path, required=True, help="where the figures go")
    parser.add_argument("--make", action="store_true", help="make demo in a fresh clone")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(Path(folder), chosen.make)
    write_result(chosen.json, figures)


def measure(folder: Path, make: bool) -> dict[str, Any]:
    """Figures of one demo, all of whose files lie in a folder."""
    clone, out = folder / "clone", folder / "out"
    command = [str(Path(sys.executable).with_name("nathlon")), "demo", "--out", str(out)]
    if make:
        subprocess.run(["git", "clone", "--quiet", HERE, clone], check=True)
        command, out = ["make", "demo"], clone / "runs" / "demo"
    load, began = os.getloadavg()[0], time.time()
    demo = subprocess.Popen(
        command,
        cwd=clone if make else HERE,
        env=os.environ | _caches(folder),
        stdout=subprocess.PIPE,
        text=True,
    )
    figures: dict[str, Any] = {"load": round(load, 1)}
    with demo:
        assert demo.stdout
        for line in demo.stdout:
            if line.startswith(VERDICT) and "verdict_s" not in figures:
                figures["verdict_s"] = round(time.time() - began, 1)
                figures["verdict_processor_s"] = round(_processor_s(demo.pid), 1)
    if demo.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {demo.returncode}")
    figures["wall_s"] = round(time.time() - began)
    figures["report_s"] = round((out / "summary.json").stat().st_mtime - began, 1)
    recorded = [path for path in (out / "races").glob("*.mcap") if path.stem != "final"]
    figures["recordings_mb"] = round(sum(path.stat().st_size for path in recorded) / MB)
    if make:
        inside = [path for path in (clone / ".venv").rglob("*") if path.is_file() and not path.is_symlink()]
        figures["environment_mb"] = round(sum(path.stat().st_size for path in inside) / MB)
    summary = read_summary(out / "summary.json")
    after = {
        "stage": "report and recordings",
        "in": "",
        "out": "",
        "races": f"{len(recorded):,}",
        "wall_s": round(figures["wall_s"] - figures["verdict_s"]),
    }
    return figures | _came_to(summary, after)


def _caches(folder: Path) -> dict[str, str]:
    """An environment in which no kernel is compiled and no line is practised yet, but packages are cached."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    packages = {f"{name.upper()}_CACHE_DIR": str(cache / name) for name in ("pip", "uv")}
    return {"XDG_CACHE_HOME": str(folder / "cache")} | {
        name: os.environ.get(name, place) for name, place in packages.items()
    }


def _processor_s(root: int) -> float:
    """Processor time of a process and all below it that have not ended, from Linux's /proc, s."""
    below: defaultdict[int, list[int]] = defaultdict(list)
    ticks: dict[int, int] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            facts = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it has ended
        below[int(facts[1])].append(int(folder.name))
        ticks[int(folder.name)] = sum(map(int, facts[11:15]))
    total, left = 0, [root]
    while left:
        process = left.pop()
        total += ticks.get(process, 0)
        left += below[process]
    return total / os.sysconf("SC_CLK_TCK")


def _came_to(summary: Summary, after: dict[str, Any]) -> dict[str, Any]:
    """What the demo came to, with a row for what follows the verdict."""
    [sent] = [row for row in summary.ranking if row.entrant == summary.sent[0].entrant]
    tied = [row.name for row in summary.ranking if row.rank == sent.rank and row.entrant != sent.entrant]
    stages = [
        {
            "stage": stage.name,
            "in": str(stage.entered),
            "out": str(stage.left),
            "races": f"{stage.races:,}" if stage.races else "",
            "wall_s": round(stage.wall_s),
        }
        for stage in summary.stages
    ]
    return {
        "stages": [*stages, after],
        "sent": sent.name,
        "points": round(sent.points_per_race or 0.0, 1),
        "points_low": round(sent.points_low or 0.0, 1),
        "points_high": round(sent.points_high or 0.0, 1),
        "races": sent.races,
        "tied": tied,
    }


if __name__ == "__main__":
    main()

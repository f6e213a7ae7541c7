"""`nathlon init`, `nathlon nightly` and `nathlon status`."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from nathlon.arena.store import Store
from nathlon.commands.console import console, print_json, say, tell, worker_count
from nathlon.commands.selection import print_selection, progress
from nathlon.config import TEMPLATE, read_config
from nathlon.nightly import nightly as run_nightly
from nathlon.nightly import told
from nathlon.output import OutputFolder
from nathlon.sim.errors import InputError


def init(path: Path, as_json: bool) -> None:
    """Write a configuration with every setting that people change."""
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(TEMPLATE.read_text("utf-8"))
    except FileExistsError:
        raise InputError(f"{path}: exists already, expected a new file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    tell({"configuration": path, "command": f"nathlon nightly --config {path}"}, as_json)


def nightly(path: Path, workers: int | None, as_json: bool) -> None:
    """Run the night, say what came of it, and exit with its code."""
    config = read_config(path)
    with progress("The same command goes on.", as_json) as on_match:
        night = run_nightly(config, worker_count(workers or config.workers), on_match)
    if as_json:
        facts: dict[str, Any] = {name: value for name, value in vars(night).items() if name != "selection"}
        print_json(facts | {"summary": night.selection and night.selection.summary.model_dump(mode="json")})
    elif night.selection and night.name:
        print_selection(night.selection, OutputFolder(Path(config.out) / night.name))
    if not as_json:
        say(f"Outcome      {night.reason}")
    sys.stdout.flush()
    told(config, night)
    raise SystemExit(night.code)


def status(path: Path, verify: bool, as_json: bool) -> None:
    """Say which nights there were, and where the one under way is."""
    config = read_config(path)
    with Store.open(config.store) as store:
        nights = [
            asdict(record) | {"facts": store.facts(record.name), "tables": _counts(store, record.name)}
            for record in store.runs()
        ]
        faults = store.verify() if verify else []
    for night in nights:
        del night["config"]
    if as_json:
        print_json({"runs": nights, "disagreements": faults})
        return
    table = Table()
    for column in ("Run", "Began (UTC)", "Status", "Entrants", "Filter", "Round robin", "Outcome"):
        table.add_column(column)
    for night in nights:
        outcome: Any = night["facts"].get("outcome") or {}
        counts = night["tables"]
        table.add_row(
            night["name"],
            night["began_at"][:19].replace("T", " "),
            night["status"],
            *(str(counts[name]) for name in ("entrants", "pareto", "ranking")),
            outcome.get("reason", _under_way(night["facts"])),
        )
    console.print(table)
    for fault in faults:
        say(fault)


def _counts(store: Store, run: str) -> dict[str, int]:
    return {name: store.table(run, name).height for name in ("entrants", "pareto", "battery", "ranking")}


def _under_way(facts: dict[str, Any]) -> str:
    at = facts.get("progress")
    return f"{at['stage']}: {at['done']:,} of {at['total']:,} matches" if at else ""

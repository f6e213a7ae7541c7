"""`nathlon init`, `nathlon nightly` and `nathlon status`."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from nathlon.commands.options import AsJson, ConfigFile, Workers
from nathlon.commands.selection import print_places, print_verdict, stoppable
from nathlon.results.words import stage_called
from nathlon.sim.errors import InputError
from nathlon.sim.process import typed
from nathlon.terminal import new_table, print_json, print_table, say, tell

if TYPE_CHECKING:
    from nathlon.arena.store import Store
    from nathlon.lab.sinks.delivery import Delivery
    from nathlon.selection.config import Config
    from nathlon.selection.nightly.night import Night


def init(
    path: Annotated[Path, typer.Argument(help="The file to write.")] = Path("nathlon.toml"),
    as_json: AsJson = False,
) -> None:
    """Write a configuration for a selection every night."""
    from nathlon.selection.config import TEMPLATE

    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(TEMPLATE.read_text("utf-8"))
    except FileExistsError:
        raise InputError(f"{path}: exists already, expected a new file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    tell({"configuration": path, "command": typed("nightly", "--config", path)}, as_json)


def nightly(
    config: ConfigFile = Path("nathlon.toml"), workers: Workers = None, as_json: AsJson = False
) -> None:
    """Select among the checkpoints that are new, and exit with a code that a scheduler understands.

    0: done, 1: nobody passed the gates, 2: bad input, 3: too many faults. The same command goes on with a
    night that was stopped.
    """
    from nathlon.selection.config import read_config
    from nathlon.selection.nightly.night import told

    settings = read_config(config)
    with stoppable("The same command goes on."):
        done = tell_night(hold_night(settings, workers, as_json), settings, as_json)
    if as_json:
        print_json(facts(done, settings))
    else:
        say_outcome(done)
    sys.stdout.flush()
    told(settings, done.night)
    raise SystemExit(done.night.code)


class Delivered(NamedTuple):
    """A night that has been told, and what became of it in the sinks that were asked for."""

    night: Night
    deliveries: tuple[Delivery, ...]


def hold_night(settings: Config, workers: int | None, as_json: bool, most: int | None = None) -> Night:
    """Go on with a night or begin one.

    Args:
        settings, most: as of `nathlon.selection.nightly.night.nightly`.
        workers: processes, instead of the configuration's.
        as_json: whether no progress is shown.

    Raises:
        InputError: as of `nightly`.
    """
    from nathlon.selection.nightly.night import nightly as run_nightly
    from nathlon.terminal.progress import stage_progress, worker_count

    with stage_progress(not as_json) as on_match:
        return run_nightly(settings, worker_count(workers or settings.workers), on_match, most)


def tell_night(night: Night, settings: Config, as_json: bool) -> Delivered:
    """Print a night's verdict, unless all is for other programs, and deliver it."""
    from nathlon.api.selection import SelectionResult

    if night.selection and night.name and not as_json:
        print_verdict(night.selection.summary)
        print_places(SelectionResult(Path(settings.out) / night.name, night.selection))
    delivered = _delivered(night, settings)
    night = replace(night, reason=night.reason + "".join(one.sentence for one in delivered))
    return Delivered(night, delivered)


def say_outcome(done: Delivered) -> None:
    """Print where a night's results have gone, and its outcome."""
    say_delivered(done.deliveries)
    say(f"Outcome      {done.night.reason}")


def facts(done: Delivered, settings: Config) -> dict[str, Any]:
    """A night for other programs: its outcome, where what is sent and the report lie, and the summary."""
    delivered = [one._asdict() for one in done.deliveries]
    return _facts(done.night, Path(settings.out)) | {"delivered": delivered}


def _delivered(night: Night, settings: Config) -> tuple[Delivery, ...]:
    """What became of a night in the sinks that were asked for."""
    if not settings.results.sinks:
        return ()
    from nathlon.lab.sinks.telling import tell_night

    return tell_night(night, settings)


def say_delivered(delivered: Iterable[Delivery]) -> None:
    """Print where results have gone."""
    for one in delivered:
        if one.place is not None:
            say(f"Delivered    {one.sink}: {one.place}")


def _facts(night: Night, nights: Path) -> dict[str, Any]:
    facts: dict[str, Any] = {name: getattr(night, name) for name in ("name", "status", "code", "reason")}
    facts |= {"excluded": [asdict(item) for item in night.excluded], "sent": [], "report": None}
    if night.selection is None or night.name is None:
        return facts | {"summary": None}
    summary = night.selection.summary
    for sent in summary.sent:
        path = sent.path and str(nights / night.name / sent.path)
        facts["sent"].append(sent.model_dump(mode="json") | {"path": path})
    report = summary.report and str(nights / night.name / summary.report)
    return facts | {"report": report, "summary": summary.model_dump(mode="json")}


def status(
    config: ConfigFile = Path("nathlon.toml"),
    verify: Annotated[
        bool, typer.Option("--verify", help="Recompute the totals of all records, and say what disagrees.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Say which nights there were, where the one under way is, and who is at work on it."""
    from nathlon.arena.claimant import at_work
    from nathlon.arena.store import Store
    from nathlon.selection.config import read_config

    with Store.open(read_config(config).store) as store:
        nights = [
            asdict(record) | {"facts": store.facts(record.name), "tables": _counts(store, record.name)}
            for record in store.runs()
        ]
        workers = at_work(store)
        faults = store.verify() if verify else []
    for night in nights:
        del night["config"]
    if as_json:
        print_json({"runs": nights, "workers": list(map(asdict, workers)), "disagreements": faults})
        return
    heads = ("Run", "Began (UTC)", "Status", "Entrants", "Filter", "Round robin", "Outcome")
    table = new_table(None, heads, words=heads)
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
    print_table(table)
    for one in workers:
        pace = "" if one.matches_per_minute is None else f", {one.matches_per_minute:g} matches a minute"
        seen = "" if one.seen_at is None else f", last seen {one.seen_at[11:19]} UTC"
        say(f"At work      {one.host}, process {one.process}, with {one.processes}{pace}{seen}")
    for fault in faults:
        say(fault)


def _counts(store: Store, run: str) -> dict[str, int]:
    return {name: store.table(run, name).height for name in ("entrants", "pareto", "battery", "ranking")}


def _under_way(facts: dict[str, Any]) -> str:
    at = facts.get("progress")
    return f"{stage_called(at['stage'])}: {at['done']:,} of {at['total']:,} matches" if at else ""

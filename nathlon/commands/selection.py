"""`nathlon demo` and `nathlon evaluate`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from arena.entrant import enter_all, find_checkpoints, trained_on
from nathlon.commands.console import console, progress_bars, say
from nathlon.output import OutputFolder
from nathlon.pipeline import Settings, select
from nathlon.run import STAGES
from reports.selection import Selection


def evaluate(checkpoints: Sequence[Path], out: Path, settings: Settings) -> None:
    """Run the selection on checkpoints and say what came of it."""
    sources = [str(path) for path in find_checkpoints(checkpoints)]
    entrants = enter_all(sources, *trained_on(sources))
    output = OutputFolder(out)
    try:
        with progress_bars() as progress:
            tasks = {stage: progress.add_task(stage, total=None, note="matches") for stage in STAGES}

            def on_match(stage: str, done: int, total: int) -> None:
                progress.update(tasks[stage], completed=done, total=total)

            selection = select(entrants, output, settings, on_match)
    except KeyboardInterrupt:
        say(f"Stopped. The same command goes on from {output.store}.")
        raise SystemExit(130) from None
    _print_ranking(selection)
    say(f"Report       {output.report / 'index.html'}")
    say(f"Spreadsheet  {output.report / 'ranking.xlsx'}")
    if selection.summary["recording"]:
        say(f"Replay       nathlon replay {output.races / 'final.mcap'}")
    say(f"Summary      {output.root / 'summary.json'}")


def _print_ranking(selection: Selection) -> None:
    ranking = selection.summary["ranking"]
    if not ranking:
        say("Fewer than two entrants reached the round robin; see the report for the filter and the tests.")
        return
    table = Table(title="Round robin, 4v4, with 95 % intervals")
    for column in ("Rank", "Entrant", "Points a race", "Contacts per km", "Races"):
        table.add_column(column, justify="left" if column == "Entrant" else "right")
    for row in ranking:
        points = (row["points_per_race"], row["points_low"], row["points_high"])
        contacts = (row["contacts_per_km"], row["contacts_low"], row["contacts_high"])
        place = "–" if row["rank"] is None else str(row["rank"])
        table.add_row(place, row["name"], _interval(*points), _interval(*contacts), str(row["races"]))
    console.print(table)


def _interval(value: float | None, low: float | None, high: float | None) -> str:
    """A figure with its interval; what the races could not tell is a dash."""
    shown = "–" if value is None else f"{value:.2f}"
    return shown if low is None or high is None else f"{shown} ({low:.2f} to {high:.2f})"

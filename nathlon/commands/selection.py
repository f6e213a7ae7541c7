"""`nathlon demo`, `nathlon evaluate` and what they share with `nathlon nightly`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.table import Table

from nathlon.arena.entrance import enter_all, trained_on
from nathlon.arena.entrant import Entrant, find_checkpoints
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.commands.console import console, print_json, progress_bars, say, warn, worker_count
from nathlon.config import Config, read_config
from nathlon.evaluation import evaluate as run_evaluation
from nathlon.output import OutputFolder
from nathlon.publish import publish
from nathlon.recordings import STAGE as RECORDINGS
from nathlon.recordings import record_tournament
from nathlon.reports.selection import Selection
from nathlon.reports.summary import Summary
from nathlon.run import STAGES, WAITING, OnMatch
from nathlon.sim.errors import InputError


def configured(
    path: Path | None, seed: int | None, shortlist: int | None, pairs: int | None, workers: int | None
) -> Config:
    """The configuration in a file, or the standard one, with what is given in its place."""
    config = Config() if path is None else read_config(path)
    committee, tournament = config.committee, config.tournament
    if shortlist is not None:
        committee = committee.model_copy(update={"shortlist": shortlist})
    if pairs is not None:
        tournament = tournament.model_copy(update={"pairs": pairs})
    changed = {"seed": seed, "workers": workers}
    given = {name: value for name, value in changed.items() if value is not None}
    return config.model_copy(update={"committee": committee, "tournament": tournament, **given})


def entered(pool: Pool, given: Iterable[str | Path], config: Config) -> tuple[list[Entrant], Config]:
    """The entrants that checkpoints, folders and names give, and the configuration for where they drive.

    Raises:
        InputError: if one cannot drive, or there is none.
    """
    sources = [str(path) for path in find_checkpoints(map(Path, given))]
    circuit, car = trained_on(pool, sources)
    return enter_all(pool, sources, circuit, car), config.model_copy(update={"circuit": circuit, "car": car})


def report(target: str, name: str | None, out: Path, record_all: bool, as_json: bool) -> None:
    """Publish a run once more from its store, with recordings of all races of its tournament if asked."""
    with Store.open(target) as store:
        runs = [record.name for record in store.runs()]
        if name is None and runs:
            name = runs[-1]
        if name not in runs:
            raise InputError(
                f"{store.name}: run is {name!r}, expected one of {', '.join(runs) or 'none yet'}"
            )
        output = OutputFolder(out)
        with Pool(worker_count(None)) as pool:
            selection = publish(store, name, output, pool)
            if record_all:
                with progress("The same command goes on.", as_json, (RECORDINGS,)) as on_match:
                    record_tournament(store, name, output, pool, on_match)
    if as_json:
        print_json(selection.summary.model_dump(mode="json"))
    elif selection.under_way:
        say(f"Run          {name}: {selection.under_way}")
        say(f"Report       {output.report / 'index.html'}")
    else:
        print_selection(selection, output)


def evaluate(checkpoints: Sequence[Path], out: Path, config: Config, as_json: bool) -> None:
    """Run the selection on checkpoints and say what came of it."""
    with Pool(worker_count(config.workers)) as pool:
        entrants, config = entered(pool, checkpoints, config)
        output = OutputFolder(out)
        with progress(f"The same command goes on from {output.store}.", as_json) as on_match:
            selection = run_evaluation(
                entrants, output, config, pool, on_match, lambda verdict: _print_now(verdict, as_json)
            )
    if as_json:
        print_json(
            selection.summary.model_dump(mode="json")
            if selection
            else {"status": WAITING, "store": output.store}
        )
    elif selection is None:
        say(f"The committee waits for its members: nathlon committee {output.store}")
    else:
        _print_files(selection.summary, output)


def _print_now(verdict: Summary, as_json: bool) -> None:
    """Print what a selection came to while its report is still to be made; JSON comes whole at the end."""
    if not as_json:
        print_verdict(verdict)
        say("Report and recordings follow. Ctrl-C stops them; the same command goes on.")


@contextmanager
def progress(stopped: str, quiet: bool, stages: Sequence[str] = (*STAGES, RECORDINGS)) -> Iterator[OnMatch]:
    """Bars for the stages that have begun, unless quiet; Ctrl-C says how to go on and exits with 130."""
    try:
        with progress_bars(quiet) as bars:
            tasks = {
                stage: bars.add_task(stage, total=None, note="matches", visible=False) for stage in stages
            }

            def on_match(stage: str, done: int, total: int) -> None:
                bars.update(tasks[stage], completed=done, total=total, visible=True)

            yield on_match
    except KeyboardInterrupt:
        warn(f"Stopped. {stopped}")
        raise SystemExit(130) from None


def print_selection(selection: Selection, output: OutputFolder) -> None:
    """Print the ranking, who is sent, and where the files are."""
    print_verdict(selection.summary)
    _print_files(selection.summary, output)


def print_verdict(verdict: Summary) -> None:
    """Print the ranking and who is sent."""
    _print_ranking(verdict)
    sent = verdict.sent
    say(f"Sent         {sent[0].name if sent else 'nobody: no finalist passed the gates'}")


def _print_files(summary: Summary, output: OutputFolder) -> None:
    say(f"Report       {output.report / 'index.html'}")
    say(f"Spreadsheet  {output.report / 'ranking.xlsx'}")
    if summary.recording:
        say(f"Replay       nathlon replay {output.races / 'final.mcap'}")
    say(f"Summary      {output.root / 'summary.json'}")


def _print_ranking(verdict: Summary) -> None:
    ranking = verdict.ranking
    if not ranking:
        say("Fewer than two entrants reached the round robin; see the report for the filter and the tests.")
        return
    table = Table(title="Round robin with 95 % intervals")
    for column in ("Rank", "Entrant", "Points a race", "Contacts per km", "Races"):
        table.add_column(column, justify="left" if column == "Entrant" else "right")
    for row in ranking:
        points = (row.points_per_race, row.points_low, row.points_high)
        contacts = (row.contacts_per_km, row.contacts_low, row.contacts_high)
        place = "–" if row.rank is None else str(row.rank)
        table.add_row(place, row.name, _interval(*points), _interval(*contacts), str(row.races))
    console.print(table)


def _interval(value: float | None, low: float | None, high: float | None) -> str:
    """A figure with its interval; what the races could not tell is a dash."""
    shown = "–" if value is None else f"{value:.2f}"
    return shown if low is None or high is None else f"{shown} ({low:.2f} to {high:.2f})"

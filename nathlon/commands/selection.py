"""`nathlon demo`, `nathlon evaluate`, `nathlon report`, and what they share with other selections."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nathlon.commands.options import (
    AsJson,
    Checkpoints,
    ConfigPath,
    ConfigSeed,
    LoaderName,
    Out,
    Pairs,
    Seed,
    Shortlist,
    StoreName,
    Workers,
    WorldName,
)
from nathlon.policies.remote import on_this_machine
from nathlon.policies.sources.finding import check_given
from nathlon.results.words import figure, percent
from nathlon.sim.errors import InputError
from nathlon.sim.process import typed
from nathlon.terminal import new_table, print_json, print_table, say, tell, warn

RESULTS = ("Won", "Drawn", "Lost")
"""Heads of columns: what became of the episodes that an entrant played."""

if TYPE_CHECKING:
    from nathlon.api.selection import SelectionResult
    from nathlon.results.standing import Crossed
    from nathlon.results.summary import SetAside, Summary
    from nathlon.selection.config import Config


def demo(
    out: Out = Path("runs/demo"),
    seed: Seed = 1,
    shortlist: Shortlist = None,
    pairs: Pairs = None,
    workers: Workers = None,
    committee: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME",
            help="Members of a committee, separated by commas, who are asked in the end whom to send.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Select the best of the bundled checkpoints: filter, n-athlon, committee, round robin, report."""
    from nathlon.policies.bundled import BUNDLED

    members = tuple(name.strip() for name in (committee or "").split(",") if name.strip())
    config, bundled = _with_members(members), [str(BUNDLED / "lindenring")]
    options: dict[str, Any] = {"config": config, "seed": seed, "shortlist": shortlist, "pairs": pairs}
    result = _select(bundled, out, as_json, workers=workers, **options)
    if members:
        store = str(result.store)
        put_again(store, members[0])
        if not as_json:
            tell({"room": typed("serve", store), "votes": typed("committee", store, "show")}, False)


def _with_members(members: tuple[str, ...]) -> Config:
    """The standard configuration with these people on the committee."""
    from pydantic import ValidationError

    from nathlon.selection.committee.rules import CommitteeSettings
    from nathlon.selection.config import Config
    from nathlon.sim.validation import first_fault

    try:
        return Config(committee=CommitteeSettings(members=members))
    except ValidationError as error:
        raise InputError(f"--committee: {first_fault(error, CommitteeSettings)}") from None


def put_again(store: str, member: str) -> None:
    """Have a member of the last run's committee put the question who is sent, unless it is open."""
    from nathlon.arena.store import Store
    from nathlon.selection.committee import reopen
    from nathlon.selection.committee.event_log import EventLog

    with Store.open(store) as opened:
        event_log = EventLog(opened, opened.runs()[-1].name)
        decision = event_log.decisions().get("selection")
        if decision is not None and decision.result is not None:
            reopen(event_log, decision, member, "To try the committee's room.")


def evaluate(
    checkpoints: Checkpoints,
    out: Out = Path("runs/evaluation"),
    config: ConfigPath = None,
    seed: ConfigSeed = None,
    shortlist: Shortlist = None,
    pairs: Pairs = None,
    workers: Workers = None,
    world: WorldName = None,
    loader: LoaderName = None,
    store: Annotated[
        str | None,
        typer.Option(help="Store of everything, path or URL; nathlon worker takes part from other machines."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Select the best of your own checkpoints, the same way as the demo.

    Exit code 0: done. 3: somebody could not be judged, as most of its runs are void.
    """
    check_given(on_this_machine(checkpoints))
    options: dict[str, Any] = {"config": config, "seed": seed, "shortlist": shortlist, "pairs": pairs}
    _select(checkpoints, out, as_json, store, workers=workers, world=world, loader=loader, **options)


def _select(
    checkpoints: list[str], out: Path, as_json: bool, store: str | None = None, **options: Any
) -> SelectionResult:
    """Select, see `nathlon.select`, and print what came of it.

    Exits with 3 where somebody could not be judged.
    """
    with at_work(f"The same command goes on from {store or out / 'store.sqlite'}."):
        from nathlon import select
        from nathlon.selection.nightly.night import HEALTH

        result = select(
            checkpoints,
            out,
            store=store,
            progress=not as_json,
            on_verdict=None if as_json else _print_now,
            **options,
        )
        if result.selection is None and as_json:
            print_json({"status": "waiting", "store": result.store})
        elif result.selection is None:
            say(repr(result))
        elif as_json:
            print_json(result.summary.model_dump(mode="json"))
        else:
            print_places(result)
    if result.selection is not None and result.summary.not_judged:
        raise SystemExit(HEALTH)
    return result


def _print_now(summary: Summary) -> None:
    """Print what a selection came to while its report is still to be made."""
    print_verdict(summary)
    say("Report and recordings follow. Ctrl-C stops them; the same command goes on.")


def report(
    store: StoreName,
    run_name: Annotated[
        str | None, typer.Option("--run", help="Name of the run; the last by default.")
    ] = None,
    out: Out = Path("runs/report"),
    record_all: Annotated[
        bool, typer.Option("--record-all", help="Record every race of the round robin.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Make the report of a run again from its store."""
    from nathlon.api.selection import SelectionResult
    from nathlon.arena.pool import Pool
    from nathlon.arena.store import Store
    from nathlon.selection.publish.output import OutputFolder
    from nathlon.selection.publish.publish import publish
    from nathlon.selection.publish.recordings import record_tournament
    from nathlon.selection.run import RECORDINGS
    from nathlon.terminal.progress import stage_progress, worker_count

    with Store.open(store) as opened:
        runs = [record.name for record in opened.runs()]
        name = runs[-1] if run_name is None and runs else run_name
        if name not in runs:
            raise InputError(
                f"{opened.name}: run is {name!r}, expected one of {', '.join(runs) or 'none yet'}"
            )
        output = OutputFolder(out)
        with (
            Pool(worker_count(None)) as pool,
            stoppable("The same command goes on."),
            stage_progress(not as_json, (RECORDINGS,)) as on_match,
        ):
            selection = publish(opened, name, output, pool, on_match)
            if record_all:
                record_tournament(opened, name, output, pool, on_match)
    if as_json:
        print_json(selection.summary.model_dump(mode="json"))
    elif selection.under_way:
        say(f"Run          {name}: {selection.under_way}")
        say(f"Report       {output.report / 'index.html'}")
    else:
        print_verdict(selection.summary)
        print_places(SelectionResult(output.root, selection))


@contextmanager
def at_work(how_to_go_on: str) -> Iterator[None]:
    """While workers are needed, which begin to load while this process does; otherwise as `stoppable`."""
    from nathlon.arena.workers import start_server

    start_server()
    with stoppable(how_to_go_on):
        yield


@contextmanager
def stoppable(how_to_go_on: str) -> Iterator[None]:
    """Ctrl-C says how to go on, and exits with 130."""
    try:
        yield
    except KeyboardInterrupt:
        warn(f"Stopped. {how_to_go_on}")
        raise SystemExit(130) from None


def print_verdict(summary: Summary) -> None:
    """Print the ranking and who is sent."""
    _print_ranking(summary)
    _print_strategies(summary.strategies)
    sent = summary.sent
    lacking = "that could be judged passed the gates" if summary.not_judged else "passed the gates"
    say(f"Sent         {sent[0].name if sent else f'nobody: no finalist {lacking}'}")
    if summary.void:
        say(f"Void         {summary.void_runs}")
    say_set_aside(summary.excluded)
    for item in summary.gone:
        say(f"Gone         {item.source} {item.reason}")
    for name, others in summary.also.items():
        say(f"Same file    {name}: also {', '.join(others)}")
    for sentence in summary.notes:
        say(f"Note         {sentence}")


def say_set_aside(excluded: Iterable[SetAside]) -> None:
    """Print what of the folders did not take part, and why."""
    for item in excluded:
        say(f"Set aside    {item.reason}")


def print_places(result: SelectionResult) -> None:
    """Print where the files are."""
    copies = [result.folder / sent.path for sent in result.summary.sent if sent.path is not None]
    for copy in copies:
        tell({"copy": copy}, False)
    tell({"report": result.report, "spreadsheet": result.spreadsheet}, False)
    if result.summary.recording:
        recording = os.path.normpath(result.report.parent / result.summary.recording)
        tell({"replay": typed("replay", recording)}, False)
    tell({"summary": result.folder / "summary.json"}, False)


def _print_ranking(summary: Summary) -> None:
    ranking = summary.ranking
    if not ranking:
        say("Fewer than two entrants reached the round robin; see the report for the filter and the tests.")
        return
    met = "tournament" not in summary.stages_set_aside
    touches = any(row.contacts_per_km is not None for row in ranking)
    means = any(row.mean is not None for row in ranking)
    points = f"Points {summary.an_episode}" if met else "n-athlon points"
    heads = ["Rank", "Entrant", *([f"{summary.a_mean} played", *RESULTS] if means else [points])]
    heads += ["Contacts per km"] if touches else []
    heads += [summary.episodes.capitalize()] if met else []
    times = {one.entrant: one for one in summary.action_times}
    heads += ["Action, ms", "Model, MB"] if times else []
    table = new_table(f"{'Round robin' if met else 'N-athlon'} with 95 % intervals", heads)
    for row in ranking:
        cells = [row.written_rank, row.name]
        if means:
            shares = (row.won, row.drawn, row.lost)
            cells.append(figure(row.mean, row.mean_low, row.mean_high))
            cells += map(percent, shares)
        else:
            cells.append(figure(row.points_per_race, row.points_low, row.points_high))
        if touches:
            cells.append(figure(row.contacts_per_km, row.contacts_low, row.contacts_high))
        cells += [str(row.races)] if met else []
        if times:
            time = times.get(row.entrant)
            cells.append("–" if time is None else time.written)
            cells.append("–" if time is None or time.model_mb is None else f"{time.model_mb:.2f}")
        table.add_row(*cells)
    print_table(table)
    if times:
        say(f"Action       {summary.timed_on}")


def _print_strategies(crossed: Sequence[Crossed]) -> None:
    """Print policies crossed with strategies, and what each of them adds."""
    if not crossed:
        return
    points = {(one.policy, one.strategy): one for one in crossed}
    policies = [one for one in crossed if not one.strategy]
    strategies = [one for one in crossed if not one.policy]
    heads = ("Policy", *(one.strategy for one in strategies), "Effect")
    table = new_table(f"Mean points a race played, over {strategies[0].units} units", heads, ("Policy",))

    def effect(one: Crossed) -> str:
        return figure(one.effect, one.effect_low, one.effect_high, "+.2f")

    for row in policies:
        both = (points[row.policy, one.strategy] for one in strategies)
        cells = (figure(one.points, one.points_low, one.points_high) for one in both)
        table.add_row(row.policy, *cells, effect(row))
    table.add_row("Effect", *map(effect, strategies), "")
    print_table(table)

"""What the commands do, with their progress and their words to the user."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Sequence
from pathlib import Path

import torch
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

import policies
from arena.entrant import Entrant, enter, enter_all, find_checkpoints
from arena.match import Match, Race, Seat
from arena.pool import match_policies
from arena.recorder import record_race
from arena.recording import write_recording
from arena.runner import run_match
from nathlon.output import OutputFolder
from nathlon.pipeline import STAGES, Settings, select
from policies.checkpoint import read_card
from policies.training.config import TrainingConfig, read_config
from policies.training.trainer import Status, Trainer
from reports.replay import open_viewer, replay_file
from reports.selection import Selection
from sim.errors import InputError
from sim.observation import ObservationSpec
from sim.scenario import load_scenario

BUNDLED = Path(str(policies.__file__)).parent / "bundled"
CONFIGS = Path(str(policies.__file__)).parent / "training" / "configs"

console = Console()


def worker_count(asked: int | None) -> int:
    """Processes to use: as asked, or one for each core."""
    return asked or os.cpu_count() or 1


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description:<12}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
    )


def evaluate(checkpoints: Sequence[Path], out: Path, settings: Settings) -> None:
    """Run the selection on checkpoints and say what came of it."""
    paths = find_checkpoints(checkpoints)
    card = read_card(paths[0])
    entrants = enter_all([str(path) for path in paths], card.circuit, card.car)
    output = OutputFolder(out)
    try:
        with _progress() as progress:
            tasks = {stage: progress.add_task(stage, total=None, note="matches") for stage in STAGES}

            def on_match(stage: str, done: int, total: int) -> None:
                progress.update(tasks[stage], completed=done, total=total)

            selection = select(entrants, output, settings, on_match)
    except KeyboardInterrupt:
        console.print(f"Stopped. The same command goes on from {output.store}.")
        raise SystemExit(130) from None
    _print_ranking(selection)
    console.print(f"Report       {output.report / 'index.html'}")
    console.print(f"Spreadsheet  {output.report / 'ranking.xlsx'}")
    if selection.summary["recording"]:
        console.print(f"Replay       nathlon replay {output.races / 'final.mcap'}")
    console.print(f"Summary      {output.root / 'summary.json'}")


def _print_ranking(selection: Selection) -> None:
    ranking = selection.summary["ranking"]
    if not ranking:
        console.print(
            "Fewer than two entrants reached the round robin; see the report for the filter and the tests."
        )
        return
    table = Table(title="Round robin, 4v4: team points a race, 95 % intervals")
    for column in ("Rank", "Entrant", "Points a race", "Interval", "Contacts per km", "Races", "Checkpoint"):
        table.add_column(column, justify="left" if column in ("Entrant", "Checkpoint") else "right")
    for row in ranking:
        table.add_row(
            str(row["rank"]),
            row["name"],
            f"{row['points_per_race']:.2f}",
            f"{row['points_low']:.2f} to {row['points_high']:.2f}",
            f"{row['contacts_per_km']:.2f}",
            str(row["races"]),
            row["entrant"][:10],
        )
    console.print(table)


def train(config: str, out: Path, seed: int, threads: int | None, resume: bool) -> None:
    """Train to the end of a configuration, or until Ctrl-C."""
    logging.basicConfig(format="%(message)s")
    torch.set_num_threads(threads or os.cpu_count() or 1)
    trainer = Trainer.resume(out) if resume else Trainer.start(out, _training_config(config), seed)
    gigabytes = trainer.replay.nbytes / 1e9
    console.print(f"Training in {out}; the replay buffer may take {gigabytes:.1f} GB.")
    try:
        with _progress() as progress:
            task = progress.add_task("updates", total=trainer.config.updates, note="warming up")

            def on_status(status: Status) -> None:
                lap = "no lap yet" if math.isnan(status.lap_s) else f"lap {status.lap_s:.1f} s"
                note = f"{status.updates_per_s:.0f}/s, {lap}, {status.off_course_share:.1%} off course"
                progress.update(task, completed=status.updates, note=note)

            trainer.run(on_status)
    except KeyboardInterrupt:
        console.print(f"Stopped at {trainer.updates} updates. Go on with: nathlon train --resume --out {out}")
        raise SystemExit(130) from None
    console.print(f"Done: {out / 'checkpoints'}")


def _training_config(name: str) -> TrainingConfig:
    if name.endswith(".toml"):
        return read_config(Path(name))
    path = CONFIGS / f"{name}.toml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in CONFIGS.glob("*.toml")))
        raise InputError(
            f"training configuration {name!r} is unknown; expected one of {known}, or a .toml path"
        )
    return read_config(path)


def race(
    sources: Sequence[str], scenario: str, circuit: str, car: str, seed: int, record: Path | None
) -> None:
    """Run one race, print its result, and keep it if a folder is given."""
    entrants = [enter(source, circuit, car) for source in dict.fromkeys(sources)]
    cars = load_scenario(scenario).cars
    seats = tuple(Seat(slot % len(entrants), slot % 2 if len(entrants) == 2 else -1) for slot in range(cars))
    if len(entrants) > cars:
        raise InputError(f"scenario {scenario}: {len(entrants)} entrants, expected at most {cars}")
    match = Match(
        "race",
        scenario,
        scenario,
        circuit,
        car,
        tuple(entrant.id for entrant in entrants),
        tuple(entrant.source for entrant in entrants),
        (Race(seed, seats),),
    )
    output = OutputFolder(record) if record else None
    policies_ = match_policies(match)
    _print_race(match, entrants)
    if output:
        log = record_race(match, policies_, 0, [entrant.name for entrant in entrants])
        path = output.races / "race.mcap"
        write_recording(path, log)
        console.print(f"Recording    {path}")


def _print_race(match: Match, entrants: Sequence[Entrant]) -> None:
    names = {entrant.id: entrant.name for entrant in entrants}
    results = run_match(match, match_policies(match)).sort("place")
    table = Table(title=f"{match.scenario} on {match.circuit}")
    for column in ("Place", "Grid", "Entrant", "Ending", "Time s", "Best lap s", "Off course s", "Contacts"):
        table.add_column(column, justify="left" if column in ("Entrant", "Ending") else "right")

    def seconds(value: float | None) -> str:
        return "" if value is None else f"{value:.3f}"

    for row in results.iter_rows(named=True):
        table.add_row(
            str(row["place"]),
            str(row["slot"]),
            names[row["entrant"]],
            row["ending"].replace("_", " "),
            seconds(row["race_time_s"]),
            seconds(row["best_lap_s"]),
            f"{row['off_course_s']:.1f}",
            str(row["contacts"]),
        )
    console.print(table)


def replay(recording: Path, show: bool) -> None:
    """Make the Rerun replay of a recording, and open it if wanted."""
    path = recording.with_suffix(".rrd")
    replay_file(recording, path)
    console.print(f"Replay       {path}")
    if show:
        open_viewer(path)


def observation(course_points: int) -> None:
    """Print the observation layout."""
    console.print(ObservationSpec(course_points=course_points).describe(), markup=False, highlight=False)

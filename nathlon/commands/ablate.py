"""`nathlon ablate`."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from nathlon.commands.options import AsJson, EngineAddress, Out
from nathlon.commands.selection import stoppable
from nathlon.selection.bounds import MOST_PAIRS, MOST_WORKERS
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from nathlon.terminal import new_table, print_json, print_table, tell, warn

if TYPE_CHECKING:
    import polars as pl
    from rich.progress import Progress

    from nathlon.policies.training.ablation import AblationRun, Train
    from nathlon.policies.training.config import TrainingConfig
    from nathlon.policies.training.log import Status

MEASURES = {"lap_s": "lap, s", "score_difference": "points a race"}


def ablate(
    config: Annotated[
        str, typer.Argument(help="time_trial, racing, or the path of a training configuration (.toml).")
    ],
    out: Out = Path("runs/ablation"),
    seeds: Annotated[
        int, typer.Option(min=1, max=10_000, help="Runs of each variant, with seeds 1, 2, ...")
    ] = 3,
    updates: Annotated[
        int | None,
        typer.Option(min=1, max=10**12, help="Updates of each run; the configuration's by default."),
    ] = None,
    variant: Annotated[
        list[str] | None, typer.Option(help="Train this variant; may be repeated. All by default.")
    ] = None,
    pairs: Annotated[
        int,
        typer.Option(min=0, max=MOST_PAIRS, help="Mirrored pairs of 4v4 races of each run against the base."),
    ] = 0,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_WORKERS, help="Threads of the learner, processes of the races."),
    ] = None,
    engine: Annotated[
        Literal["local", "ray"],
        typer.Option(help="Where runs are trained: this machine, or a cluster, all at once."),
    ] = "local",
    engine_address: EngineAddress = "auto",
    as_json: AsJson = False,
) -> None:
    """Train variants of a configuration without parts of the method, and draw what the parts are worth.

    The same command goes on after Ctrl-C.
    """
    need("torch", "train", "an ablation")
    import torch

    from nathlon.policies.training.ablation import VARIANTS, claim, configurations, plan
    from nathlon.sim.folder_lock import sole_user
    from nathlon.terminal.progress import progress_bars, worker_count

    logging.basicConfig(format="%(message)s")
    torch.set_num_threads(worker_count(workers))
    base = _base(config, updates)
    names = variant or VARIANTS
    configs = configurations(base, names)
    runs = plan(configs, seeds, out)
    with sole_user(out), stoppable("The same command goes on."):
        claim(out, base)
        for name in names:
            if name not in configs:
                warn(f"{name} is the configuration itself, and left out.")
        with progress_bars(not as_json) as progress:
            with _training(engine, engine_address) as train:
                diverged = _train(train, runs, out, progress)
            raced = _race(runs, out, pairs, worker_count(workers), progress) if pairs else None
        found = _publish(runs, out, raced)
    files = {
        "figure": out / "ablation.svg",
        "table": out / "ablation.csv",
        "effects": out / "effects.csv",
    }
    if as_json:
        print_json({"runs": len(runs), **files, "differences": found.to_dicts()})
    else:
        _print_effects(found)
        tell({"runs": len(runs), **files}, False)
    if diverged:
        raise InputError(
            f"{out}: {diverged} of {len(runs)} runs diverged; figure and table show what they did"
        )


def _base(name: str, updates: int | None) -> TrainingConfig:
    from nathlon.policies.training.config import CONFIGS, read_config
    from nathlon.sim.data_file import find_data

    config = read_config(find_data(name, "training configuration", CONFIGS))
    if updates is not None:
        config = config.model_copy(update={"updates": updates})
    if config.updates < config.checkpoint_every:
        raise InputError(
            f"{name}: updates is {config.updates}, "
            f"expected at least the {config.checkpoint_every} of checkpoint_every"
        )
    return config


@contextmanager
def _training(engine: str, address: str) -> Iterator[Train]:
    """What trains runs: this process, or the processors of a cluster."""
    if engine == "local":
        from nathlon.policies.training.ablation import train_in_turn

        yield train_in_turn
        return
    from nathlon.arena.on_ray.cluster import joined

    with joined(address):
        from nathlon.policies.training.on_ray.runs import train_on_cluster

        yield train_on_cluster


def _train(train: Train, runs: Sequence[AblationRun], out: Path, progress: Progress) -> int:
    """Train those that are not finished, and publish after each; the number of those that diverged."""
    updates = {str(run): run.updates for run in runs}
    ended = sum(run.finished for run in runs)
    overall = progress.add_task("runs", total=len(runs), completed=ended, note="")
    task = progress.add_task(
        "updates", total=sum(run.config.updates for run in runs), completed=sum(updates.values()), note=""
    )

    def on_status(run: AblationRun, status: Status) -> None:
        updates[str(run)] = status.updates
        lap = "no lap yet" if math.isnan(status.lap_s) else f"lap {status.lap_s:.1f} s"
        note = f"{run}: {status.updates_per_s:.0f}/s, {lap}"
        progress.update(task, completed=sum(updates.values()), note=note)

    diverged = 0
    for why in train([run for run in runs if not run.finished], on_status):
        if why:
            warn(why)
            diverged += 1
        progress.advance(overall)
        _publish(runs, out)
    return diverged


def _race(
    runs: Sequence[AblationRun], out: Path, pairs: int, workers: int, progress: Progress
) -> pl.DataFrame:
    from nathlon.arena.store import Store
    from nathlon.judge.ablation import race_base

    task = progress.add_task("races", total=None, note="matches")

    def on_match(done: int, total: int) -> None:
        progress.update(task, completed=done, total=total)

    with Store(out / "store.sqlite") as store:
        return race_base(runs, pairs, workers, store, on_match)


def _publish(runs: Sequence[AblationRun], out: Path, duels: pl.DataFrame | None = None) -> pl.DataFrame:
    """Write table and figure of the runs so far; what the variants differ from the base, EFFECTS."""
    import polars as pl

    from nathlon.judge.ablation import DUELS, checkpoints, effects
    from nathlon.reports.ablation import write_ablation

    table = checkpoints(runs, pl.DataFrame(schema=DUELS) if duels is None else duels)
    found = effects(table)
    write_ablation(table, found, out)
    return found


def _print_effects(found: pl.DataFrame) -> None:
    title = "Last checkpoints minus the base's, 95 % confidence intervals"
    heads = ("Variant", "Seeds", "Measure", "Difference", "Interval")
    shown = new_table(title, heads, ("Variant", "Measure", "Interval"))
    for row in found.iter_rows(named=True):
        cells = [str(row["seeds"]), MEASURES[row["measure"]]]
        if row["difference"] is None:
            shown.add_row(row["variant"], *cells, "", "a seed has no lap")
            continue
        known = row["low"] is not None
        interval = f"{row['low']:+.2f} to {row['high']:+.2f}" if known else "one seed, or all alike"
        shown.add_row(row["variant"], *cells, f"{row['difference']:+.2f}", interval)
    print_table(shown)

"""`nathlon train` and `nathlon polish`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from nathlon.commands.options import AsJson, EngineAddress, Out, Seed
from nathlon.commands.selection import stoppable
from nathlon.selection.bounds import MOST_WORKERS
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from nathlon.sim.process import typed
from nathlon.terminal import tell

if TYPE_CHECKING:
    from nathlon.policies.training.polish import Round


def train(
    config: Annotated[
        str,
        typer.Argument(
            help="time_trial, racing (also as CIRCUIT-racing ..), paper, or the path of a .toml file."
        ),
    ] = "time_trial",
    out: Out = Path("runs/training"),
    seed: Seed = 1,
    threads: Annotated[
        int | None, typer.Option(min=1, max=MOST_WORKERS, help="Threads of the learner.")
    ] = None,
    device: Annotated[
        Literal["cpu", "cuda"], typer.Option(help="Device on which networks are updated.")
    ] = "cpu",
    engine: Annotated[
        Literal["local", "ray"], typer.Option(help="Where rollout workers run: this machine or a cluster.")
    ] = "local",
    engine_address: EngineAddress = "auto",
    resume: Annotated[bool, typer.Option("--resume", help="Continue the run in the folder.")] = False,
    origin: Annotated[
        Path | None,
        typer.Option("--from", help="Run whose networks this one starts with, or checkpoint whose policy."),
    ] = None,
    coach: Annotated[
        list[Path] | None,
        typer.Option(help="coach.json of nathlon coach: begin where the lap lost most; may be repeated."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Train a policy with QR-SAC; Ctrl-C stops, --resume goes on."""
    if resume and (origin is not None or coach):
        raise InputError("--from, --coach: expected for a new run, not with --resume")
    need("torch", "train", "training")
    import nathlon

    with stoppable(f"Go on with: {typed('train', '--resume', '--out', out)}"):
        result = nathlon.train(
            config,
            out,
            seed=seed,
            threads=threads,
            device=device,
            engine=engine,
            engine_address=engine_address,
            resume=resume,
            origin=origin,
            coach=coach or (),
            progress=not as_json,
        )
    tell({"updates": result.updates, "checkpoints": out / "checkpoints"}, as_json)


def polish(
    checkpoint: Annotated[Path, typer.Argument(help="Checkpoint to start from.")],
    config: Annotated[
        str, typer.Option(help="Training configuration whose races and reward count: name or path.")
    ] = "time_trial",
    out: Out = Path("runs/polished"),
    rounds: Annotated[int, typer.Option(min=1, max=10**9, help="Number of rounds.")] = 100,
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Improve a checkpoint by what its actions bring in races; the same command goes on after Ctrl-C."""
    need("torch", "train", "polishing")
    from nathlon.policies.training.config import CONFIGS, read_config
    from nathlon.policies.training.polish import Polish
    from nathlon.sim.data_file import find_data
    from nathlon.sim.folder_lock import sole_user
    from nathlon.terminal.progress import progress_bars

    settings = read_config(find_data(config, "training configuration", CONFIGS))
    with (
        sole_user(out),
        stoppable("Go on with the same command."),
        progress_bars(not as_json) as progress,
    ):
        work = Polish(checkpoint, settings, out, rounds, seed)
        task = progress.add_task("rounds", total=rounds, completed=work.rounds, note="")

        def on_round(done: Round) -> None:
            progress.update(task, completed=done.rounds, note=f"reward {done.reward:.1f}")

        def on_pair(ready: int, count: int) -> None:
            progress.update(task, note=f"{ready} of {count} circuits and cars practised")

        work.run(on_round, on_pair)
    tell({"rounds": work.rounds, "checkpoints": out / "checkpoints"}, as_json)

"""`nathlon polish`."""

from __future__ import annotations

from pathlib import Path

from nathlon.commands.console import progress_bars, tell, warn
from nathlon.policies.training.config import CONFIGS, read_config
from nathlon.policies.training.polish import Polish, Round
from nathlon.sim.data_file import find_data


def polish(checkpoint: Path, config: str, out: Path, rounds: int, seed: int, as_json: bool) -> None:
    """Polish a checkpoint to the last round, or until Ctrl-C."""
    settings = read_config(find_data(config, "training configuration", CONFIGS))
    work = Polish(checkpoint, settings, out, rounds, seed)
    try:
        with progress_bars(as_json) as progress:
            task = progress.add_task("rounds", total=rounds, completed=work.rounds, note="")

            def on_round(done: Round) -> None:
                progress.update(task, completed=done.rounds, note=f"reward {done.reward:.1f}")

            work.run(on_round)
    except KeyboardInterrupt:
        warn(f"Stopped after {work.rounds} rounds. Go on with the same command.")
        raise SystemExit(130) from None
    tell({"rounds": work.rounds, "checkpoints": out / "checkpoints"}, as_json)

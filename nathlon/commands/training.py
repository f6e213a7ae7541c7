"""`nathlon train`."""

from __future__ import annotations

import logging
import math
import os
from pathlib import Path

import torch

from nathlon.commands.console import progress_bars, tell, warn
from nathlon.policies.training.config import CONFIGS, read_config
from nathlon.policies.training.log import Status
from nathlon.policies.training.trainer import Device, Trainer
from nathlon.sim.data_file import find_data
from nathlon.sim.errors import InputError


def train(
    config: str,
    out: Path,
    seed: int,
    threads: int | None,
    device: Device,
    resume: bool,
    origin: Path | None,
    as_json: bool,
) -> None:
    """Train to the end of a configuration, or until Ctrl-C."""
    logging.basicConfig(format="%(message)s")
    if resume and origin is not None:
        raise InputError("--from: expected for a new run, not with --resume")
    if resume:
        trainer = Trainer.resume(out, device)
    else:
        path = find_data(config, "training configuration", CONFIGS)
        trainer = Trainer.start(out, read_config(path), seed, origin, device)
    # Two threads of matrix products beside a busy process are slower than one.
    torch.set_num_threads(threads or max((os.cpu_count() or 1) - trainer.config.workers, 1))
    gigabytes = trainer.replay.nbytes / 1e9
    warn(f"Training in {out}; the replay tables may take {gigabytes:.1f} GB.")
    try:
        with progress_bars(as_json) as progress:
            task = progress.add_task("updates", total=trainer.config.updates, note="warming up")

            def on_status(status: Status) -> None:
                lap = "no lap yet" if math.isnan(status.lap_s) else f"lap {status.lap_s:.1f} s"
                note = f"{status.updates_per_s:.0f}/s, {lap}, {status.off_course_share:.1%} off course"
                progress.update(task, completed=status.updates, note=note)

            trainer.run(on_status)
    except KeyboardInterrupt:
        warn(f"Stopped at {trainer.updates} updates. Go on with: nathlon train --resume --out {out}")
        raise SystemExit(130) from None
    tell({"updates": trainer.updates, "checkpoints": out / "checkpoints"}, as_json)

"""Whole training runs on a Ray cluster, a processor each; what they write comes here as it is made."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from nathlon.policies.ray_actor import start_actor
from nathlon.policies.training.ablation import AblationRun, OnStatus
from nathlon.policies.training.on_ray.run_actor import Report, RunActor, RunStart
from nathlon.policies.training.on_ray.travel import needed, pack
from nathlon.policies.training.on_ray.workers import WAIT_S, WARN_S
from nathlon.policies.training.run_folder import CONFIG_FILE
from nathlon.policies.training.state import STATE_FILE
from nathlon.sim.decisive import fingerprint
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import write_whole, writing

log = logging.getLogger(__name__)

REPORT_S = 2.0
"""Between two reports of a run."""
LIVES = 3
"""Actors that a run may lose in a row, none of which has made a checkpoint."""

_actors = count(1)


@dataclass(eq=False)
class _Trainee:
    """A run and who trains it.

    Attributes:
        end: of the training, under way.
        report: asked for; None between two.
        losses: actors lost in a row before a checkpoint came.
    """

    run: AblationRun
    actor: Any
    end: Any
    report: Any
    losses: int


def train_on_cluster(runs: Iterable[AblationRun], on_status: OnStatus) -> Iterator[str]:
    """Train runs on the cluster that this process has joined, one on each free processor; see `Train`.

    Raises:
        InputError: if the folder of a run cannot be used, a run cannot be trained, or nobody trains it.
    """
    with _Training(runs) as training:
        yield from training.ended(on_status)


class _Training:
    """Runs and the actors that train them; to be used in a `with` statement."""

    def __init__(self, runs: Iterable[AblationRun]) -> None:
        """Ask for an actor for each run; they begin as processors become free."""
        self._trainees = [self._start(run) for run in runs]
        self._asked, self._reported, self._warned = time.monotonic(), False, False

    def __enter__(self) -> _Training:
        return self

    def __exit__(self, *_: object) -> None:
        import ray

        for trainee in self._trainees:
            ray.kill(trainee.actor)

    def ended(self, on_status: OnStatus) -> Iterator[str]:
        """As of `train_on_cluster`."""
        import ray

        while self._trainees:
            ray.wait([trainee.end for trainee in self._trainees], timeout=REPORT_S)
            for trainee in list(self._trainees):
                try:
                    ended = bool(ray.wait([trainee.end], timeout=0)[0])
                    if ended or ray.wait([trainee.report], timeout=0)[0]:
                        self._write(trainee, ray.get(trainee.report), on_status)
                        trainee.report = trainee.actor.report.remote()
                    if ended:
                        diverged = ray.get(trainee.end)
                        # What came after the report before.
                        self._write(trainee, ray.get(trainee.report), on_status)
                        self._trainees.remove(trainee)
                        ray.kill(trainee.actor)
                        yield diverged
                except ray.exceptions.RayTaskError as error:
                    # What is wrong with a run is so on every node.
                    if isinstance(error.cause, InputError):
                        raise InputError(str(error.cause)) from None
                    raise
                except ray.exceptions.RayError:
                    self._replace(trainee)
            self._check()

    def _write(self, trainee: _Trainee, report: Report, on_status: OnStatus) -> None:
        """Put down what a run has written, and tell where it stands.

        The state comes last, as where it was made: who goes on from it finds the others.
        """
        folder = trainee.run.folder
        with writing(folder):
            for name, content in sorted(report.files.items(), key=lambda file: file[0] == STATE_FILE):
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                write_whole(folder / name, content)
        self._reported = True
        if STATE_FILE in report.files:
            trainee.losses = 0
        if report.status:
            on_status(trainee.run, report.status)

    def _start(self, run: AblationRun, losses: int = 0) -> _Trainee:
        run.claim()
        called = f"nathlon training {next(_actors)}: {run}", f"training of {run}"
        # A run that is lost goes on from what has come here.
        actor = start_actor(RunActor, *called, num_cpus=1, max_concurrency=2, scheduling_strategy="SPREAD")
        parcels = [pack(name) for name in needed(run.config, [])]
        start = RunStart(fingerprint(), run.config, run.seed, parcels, _files(run.folder))
        return _Trainee(run, actor, actor.train.remote(start), actor.report.remote(), losses)

    def _replace(self, lost: _Trainee) -> None:
        import ray

        ray.kill(lost.actor)
        if lost.losses + 1 == LIVES:
            raise InputError(
                f"engine 'ray': {lost.run} has lost {LIVES} processes, none of which made a checkpoint, "
                "expected one that does"
            )
        log.warning("engine 'ray': %s is lost; it goes on from its last checkpoint", lost.run)
        self._trainees.remove(lost)
        self._trainees.append(self._start(lost.run, lost.losses + 1))

    def _check(self) -> None:
        """See that somebody trains, or may be hoped to."""
        waited_s = time.monotonic() - self._asked
        if self._reported or waited_s < WARN_S:
            return
        if not self._warned:
            log.warning("engine 'ray': all runs wait for a free processor")
            self._warned = True
        if waited_s > WAIT_S:
            raise InputError(
                f"engine 'ray': no processor of the cluster was free for {WAIT_S:.0f} s, expected one"
            )


def _files(folder: Path) -> dict[str, bytes]:
    """What a run has left so far, but for what says which run it is."""
    try:
        left = [path for path in sorted(folder.rglob("[!.]*")) if path.is_file()]
        files = {str(path.relative_to(folder)): path.read_bytes() for path in left}
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror}") from None
    del files[CONFIG_FILE]
    return files

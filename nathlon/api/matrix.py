"""`nathlon.matrix`: in which settings a policy is worse than another."""

from __future__ import annotations

from html import escape
from pathlib import Path

import polars as pl

from nathlon.api.candidates import Candidate, one_source
from nathlon.api.selection import at_home, configured
from nathlon.arena.entrance import endings_of
from nathlon.arena.pool import Pool
from nathlon.arena.world_registry import load_world
from nathlon.judge.matrix.cells import plan_cells
from nathlon.judge.matrix.matrix import run_matrix
from nathlon.judge.matrix.replays import record_worst
from nathlon.reports.matrix_page import write_matrix_page
from nathlon.results.matrix import MatrixReport, write_matrix
from nathlon.selection.config import Config
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.run import KERNELS, MATRIX, RECORDINGS
from nathlon.selection.single_run import single_run
from nathlon.sim.whole_file import check_output
from nathlon.terminal.progress import stage_progress, worker_count


class MatrixResult:
    """What a matrix came to, and where it has left everything.

    Attributes:
        folder: of all that it has left: `matrix.json`, `matrix.csv`, `index.html`, `replays`, `store.sqlite`.
        report: what `matrix.json` holds.
    """

    def __init__(self, folder: Path, report: MatrixReport) -> None:
        self.folder, self.report = folder, report

    @property
    def cells(self) -> pl.DataFrame:
        """One row a cell and measure, what got worse first; as in `matrix.csv`."""
        return self.report.frame()

    def __repr__(self) -> str:
        worst = [cell for cell in self.report.ordered() if cell.verdict == "worse"][:5]
        return "\n".join([self.report.headline, *(f"worse: {cell.label}" for cell in worst)])

    def _repr_html_(self) -> str:
        return f"<h3>{escape(self.report.headline)}</h3>" + self.cells.head(20)._repr_html_()


def matrix(
    policy: Candidate,
    out: str | Path = "runs/matrix",
    *,
    baseline: Candidate | None = None,
    config: Config | str | Path | None = None,
    seed: int | None = None,
    workers: int | None = None,
    world: str | None = None,
    loader: str | None = None,
    progress: bool = True,
) -> MatrixResult:
    """Drive a policy through a matrix of settings beside a baseline, and find where it is worse.

    Every cell is driven a few times by both from the same starts, among the same opponents; the cells that
    look worst are then driven on other starts until it is proven or not. The same call goes on with a matrix
    that was stopped.

    Args:
        policy: a checkpoint, `plugin:NAME` or an object.
        out: folder for everything that the matrix leaves; it may be that of earlier ones.
        baseline: beside whom; the world's own, in our simulator the built-in driver, if there is none.
        config: whose section `matrix` has the settings, or the path of a `nathlon.toml`.
        seed, workers: instead of the configuration's.
        world: the simulator, instead of the configuration's.
        loader: as of `nathlon.select`.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if nothing can be driven, policy and baseline are the same, a name or file is wrong, or
            the folder cannot be written.
    """
    settings = configured(config, seed, workers=workers, world=world, loader=loader)
    check_output(Path(out))
    with Pool(worker_count(settings.workers)) as pool:
        endings = endings_of(pool, settings.world)
        driver = one_source(policy, endings=endings)
        settings = at_home(pool, [driver], settings)
        where = settings.world, settings.circuit, settings.car
        other = load_world(*where).baseline if baseline is None else one_source(baseline, endings=endings)
        output = OutputFolder(Path(out))
        plan = plan_cells(pool, driver, other, settings)
        pair = next(iter(plan.pairs.values()))
        with (
            stage_progress(progress, (KERNELS, MATRIX, RECORDINGS)) as on_match,
            single_run(MATRIX, pair, settings, output.store, pool, on_match) as run,
            output.filling(),
        ):
            report, driven = run_matrix(run, plan, settings)
            report = record_worst(run, report, driven, settings.matrix.replays, output)
            write_matrix(report, output.root)
            write_matrix_page(report, output.root)
    return MatrixResult(output.root, report)

"""Replays of what got worse: the policy's worst run beside the baseline's from the same start."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from nathlon.arena.job import Wanted
from nathlon.arena.match import TESTED
from nathlon.arena.recording import write_recording
from nathlon.judge.matrix.cells import Cell, CellSetting
from nathlon.judge.matrix.driving import DrivenCell, worse
from nathlon.judge.matrix.matrix import Matrix
from nathlon.reports.twin_page import write_twin_page
from nathlon.results.matrix import CellReport, MatrixReport
from nathlon.results.twin import Side, Twins
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.run import RECORDINGS, Run
from nathlon.sim.errors import InputError

log = logging.getLogger(__name__)


def record_worst(
    run: Run, report: MatrixReport, matrix: Matrix, most: int, output: OutputFolder
) -> MatrixReport:
    """Leave recordings and a page of the worst run, by baseline and policy, in each of the worst cells.

    In another world nothing is recorded. Why a race cannot be is logged.

    Returns:
        the report with the paths of the pages.
    """
    worst = [cell for cell in report.ordered() if cell.verdict == "worse"][:most]
    if not worst or not worst[0].circuit:
        return report
    driven = {cell.label: _worst_run(report, cell, matrix) for cell in worst}
    sides = _record(run, report, list(driven.values()))
    pages: dict[str, str] = {}
    for number, (label, one) in enumerate(driven.items(), 1):
        policy, baseline = (sides.get((match.key, one.race)) for match in one.matches)
        if policy and baseline:
            page = _write(Twins(baseline, policy, _tested(one)), output.replays, f"{number:02d}")
            pages[label] = page.relative_to(output.root).as_posix()
    cells = [cell.model_copy(update={"replay": pages.get(cell.label)}) for cell in report.cells]
    return report.model_copy(update={"cells": tuple(cells)})


def _worst_run(report: MatrixReport, cell: CellReport, matrix: Matrix) -> DrivenCell:
    """The run of a cell in which the policy was worst, in the measure in which the cell is."""
    margins = [
        finding.worse / max(measure.margin, 1e-9) if finding.verdict == "worse" and finding.worse else -np.inf
        for measure, finding in zip(report.measures, cell.findings, strict=True)
    ]
    name = report.measures[int(np.argmax(margins))].name
    how = matrix.driving.measures[name]
    setting = CellSetting(**{field: getattr(cell, field) for field in CellSetting._fields})
    screening, fresh = matrix.driving.runs[Cell(setting, cell.place)]
    return max([*screening, *fresh], key=lambda one: np.nan_to_num(worse(how, one.marks[name]), nan=-np.inf))


def _tested(one: DrivenCell) -> int:
    """The car of a run that is the policy's in one match and the baseline's in the other."""
    seats = one.matches[0].races[one.race].seats
    return next(car for car, seat in enumerate(seats) if seat.team == TESTED)


def _record(run: Run, report: MatrixReport, driven: list[DrivenCell]) -> dict[tuple[str, int], Side]:
    """Races by match and index, with what the drivers saw, as far as they can be run again."""
    names = {report.policy_id: report.policy, report.baseline_id: report.baseline}
    wanted = {
        (match.key, one.race): Wanted(
            match,
            (one.race,),
            tuple(names.get(entrant, entrant) for entrant in match.entrants),
            run.store.results_of([match.key]),
            seen_by=_tested(one),
        )
        for one in driven
        for match in one.matches
    }
    run.on_match(RECORDINGS, 0, len(wanted))
    sides: dict[tuple[str, int], Side] = {}
    for done, (_, answer) in enumerate(run.pool.record(list(wanted.values())), 1):
        if isinstance(answer, InputError):
            log.warning("%s", answer)
        else:
            [race] = answer.logs
            sides[race.match, race.race] = Side(race, answer.seen)
        run.on_match(RECORDINGS, done, len(wanted))
    return sides


def _write(twins: Twins, folder: Path, name: str) -> Path:
    """Leave both races as recordings, and side by side as a page, whose path it returns."""
    write_recording(folder / f"{name}-baseline.mcap", twins.original.log)
    write_recording(folder / f"{name}-policy.mcap", twins.twin.log)
    page = folder / f"{name}.html"
    write_twin_page(twins, page)
    return page

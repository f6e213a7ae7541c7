"""Replays of what got worse: the policy's worst run, and the baseline's from the same start."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from nathlon.arena.job import Wanted
from nathlon.arena.match import TESTED, Match
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import write_recording
from nathlon.arena.worlds.registry import RACING
from nathlon.publishing.output import OutputFolder
from nathlon.reports.matrix import CellReport, MatrixReport
from nathlon.reports.player import write_player
from nathlon.selection.run import RECORDINGS, Run
from nathlon.settings_matrix.cells import Cell, Setting
from nathlon.settings_matrix.driving import Driven, worse
from nathlon.settings_matrix.matrix import Matrix
from nathlon.sim.errors import InputError

log = logging.getLogger(__name__)


def record_worst(
    run: Run, report: MatrixReport, matrix: Matrix, most: int, output: OutputFolder
) -> MatrixReport:
    """Leave a recording and a page of the worst run, by policy and baseline, in each of the worst cells.

    In another world nothing is recorded. Why a race cannot be is logged.

    Returns:
        the report with the paths of the pages.
    """
    worst = [cell for cell in report.ordered() if cell.verdict == "worse"][:most]
    if report.world != RACING or not worst:
        return report
    driven = {cell.label: _worst_run(report, cell, matrix) for cell in worst}
    races = {(match.key, one.race) for one in driven.values() for match in one.matches}
    logs = _record(run, report, {m.key: m for one in driven.values() for m in one.matches}, races)
    pages: dict[str, tuple[str, ...]] = {}
    for number, (label, one) in enumerate(driven.items(), 1):
        written = [
            _write(logs[match.key, one.race], match, one.race, output, f"{number:02d}-{called}")
            for match, called in zip(one.matches, ("policy", "baseline"), strict=True)
            if (match.key, one.race) in logs
        ]
        pages[label] = tuple(path.relative_to(output.root).as_posix() for path in written)
    cells = [cell.model_copy(update={"replays": pages.get(cell.label, ())}) for cell in report.cells]
    return report.model_copy(update={"cells": tuple(cells)})


def _worst_run(report: MatrixReport, cell: CellReport, matrix: Matrix) -> Driven:
    """The run of a cell in which the policy was worst, in the measure in which the cell is."""
    margins = [
        finding.worse / max(measure.margin, 1e-9) if finding.verdict == "worse" and finding.worse else -np.inf
        for measure, finding in zip(report.measures, cell.findings, strict=True)
    ]
    name = report.measures[int(np.argmax(margins))].name
    how = matrix.driving.measures[name]
    setting = Setting(cell.circuit, cell.car, cell.scenario, cell.compound, cell.delay_s)
    screening, fresh = matrix.driving.runs[Cell(setting, cell.place)]
    return max([*screening, *fresh], key=lambda one: np.nan_to_num(worse(how, one.marks[name]), nan=-np.inf))


def _record(
    run: Run, report: MatrixReport, matches: dict[str, Match], races: set[tuple[str, int]]
) -> dict[tuple[str, int], RaceLog]:
    """The logs of races by match and index, as far as they can be run again."""
    names = {report.policy_id: report.policy, report.baseline_id: report.baseline}
    wanted = [
        Wanted(
            match,
            tuple(sorted(race for key, race in races if key == match.key)),
            tuple(names.get(entrant, entrant) for entrant in match.entrants),
            run.store.results_of([match.key]),
        )
        for match in matches.values()
    ]
    run.on_match(RECORDINGS, 0, len(wanted))
    logs: dict[tuple[str, int], RaceLog] = {}
    for done, (match, answer) in enumerate(run.pool.record(wanted), 1):
        if isinstance(answer, InputError):
            log.warning("%s", answer)
        else:
            logs |= {(match.key, one.race): one for one in answer.logs}
        run.on_match(RECORDINGS, done, len(wanted))
    return logs


def _write(log: RaceLog, match: Match, race: int, output: OutputFolder, name: str) -> Path:
    """Leave a race as `replays`/`name`.mcap and .html, whose path it returns."""
    tested = next(car for car, seat in enumerate(match.races[race].seats) if seat.team == TESTED)
    write_recording(output.replays / f"{name}.mcap", log)
    page = output.replays / f"{name}.html"
    write_player(log, page, tested)
    return page

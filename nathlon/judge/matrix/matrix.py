"""Running a matrix: a screening of all cells, then fresh runs of those that look worst."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.statistics import Floats
from nathlon.judge.matrix.cells import Cell, CellSetting, MatrixPlan
from nathlon.judge.matrix.driving import CONFIRMATION, SCREENING, Driving, begin, drive
from nathlon.judge.matrix.evidence import (
    LOOKS_WORSE,
    TRIED_RUNS,
    Mean,
    Shrunk,
    as_one_cell,
    discovered,
    looks,
    mean_over_cells,
    mishap,
    no_worse,
    p_worse,
    rate_of_look,
    shrink,
    variances_of_means,
)
from nathlon.results.matrix import CellReport, LevelReport, MatrixFinding, MatrixMeasure, MatrixReport, Said
from nathlon.results.summary import versions
from nathlon.selection.config import Config
from nathlon.selection.matrix_settings import MatrixSettings
from nathlon.selection.run import Run
from nathlon.sim.errors import InputError
from nathlon.tournament.completion import breaks_more

DIMENSIONS = (*CellSetting._fields, "place")
"""Of a cell, in the order of `CellSetting` with the place after it."""
COVERED = 1.96
"""Standard deviations on either side of an estimate: 95 %."""


class Suspect(NamedTuple):
    """A cell in a measure in which it may be worse: by their indices."""

    cell: int
    measure: int


@dataclass
class Matrix:
    """A matrix under way.

    Attributes:
        plan: its cells.
        driving: the runs so far.
        margins: by measure, in the order of `driving.measures`; without those that nothing is measured of.
        suspects: what looked worse in the screening.
        worse: which of them are.
        given_up: which of them do not look it any more.
    """

    plan: MatrixPlan
    driving: Driving
    margins: dict[str, float]
    suspects: list[Suspect] = field(default_factory=list)
    worse: set[Suspect] = field(default_factory=set)
    given_up: set[Suspect] = field(default_factory=set)


def run_matrix(run: Run, plan: MatrixPlan, config: Config) -> tuple[MatrixReport, Matrix]:
    """Find the cells in which the policy is worse than the baseline by more than the margins.

    A false discovery rate holds over all of them: looks at the fresh runs of the suspects share it out, and
    what the screening said of them does not count as proof.

    Raises:
        InputError: if the world has no such measure, or nothing is measured.
    """
    began = time.perf_counter()
    asked = config.matrix
    for circuit, car in plan.pairs:
        run.compile(config.world, circuit, car)
    try:
        driving = begin(plan, asked.margins)
    except KeyError as error:
        raise InputError(
            f"section matrix: margins has {error}: world {config.world!r} measures nothing of the kind"
        ) from None
    drive(run, plan, driving, plan.settings(), SCREENING, slice(0, asked.runs), asked.opponents)
    margins = {name: margin for name, margin in asked.margins.items() if _is_measured(plan, driving, name)}
    if all(lost.hides for lost in driving.void.values()):
        margins = dict(asked.margins)  # nobody knows what would be measured
    if not margins:
        raise InputError("section matrix: margins: nothing of the kind is measured here")
    matrix = Matrix(plan, driving, margins)
    matrix.suspects = _suspects(matrix, asked.confirm)
    _confirm(run, matrix, asked)
    return _report(run, matrix, config, time.perf_counter() - began), matrix


def _is_measured(plan: MatrixPlan, driving: Driving, measure: str) -> bool:
    return bool(np.isfinite(driving.differences(plan.cells, measure)).any())


def estimates(matrix: Matrix, measure: str) -> Shrunk:
    """How much worse the policy is in each cell, by all runs; NaN where none was measured."""
    cells = matrix.plan.cells
    differences = matrix.driving.differences(cells, measure)
    known = np.isfinite(differences).any(axis=1)
    mean, error = np.full((2, len(cells)), np.nan)
    if not known.any():
        return Shrunk(mean, error)
    some = differences[known]
    here = shrink(np.nanmean(some, axis=1), variances_of_means(some), _levels(cells)[known])
    mean[known], error[known] = here
    return Shrunk(mean, error)


def _columns(cells: list[Cell]) -> list[tuple[str | int | float, ...]]:
    """The levels of all cells, by `DIMENSIONS`."""
    return list(zip(*((*cell.setting, cell.place) for cell in cells), strict=True))


def _levels(cells: list[Cell]) -> NDArray[np.int64]:
    """(cells, dimensions) indices of the levels."""
    indices = []
    for column in _columns(cells):
        numbers = {level: number for number, level in enumerate(dict.fromkeys(column))}
        indices.append([numbers[level] for level in column])
    return np.array(indices, np.int64).T


def _suspects(matrix: Matrix, most_cells: int) -> list[Suspect]:
    """What may be worse by its margin, in those cells that look worst."""
    chances = np.array(
        [np.nan_to_num(estimates(matrix, name).above(margin)) for name, margin in matrix.margins.items()]
    ).T
    worst = np.argsort(-chances.max(axis=1), kind="stable")[:most_cells]
    return [
        Suspect(int(cell), int(measure))
        for cell in sorted(worst)
        for measure in np.flatnonzero(chances[cell] >= LOOKS_WORSE)
    ]


def _confirm(run: Run, matrix: Matrix, asked: MatrixSettings) -> None:
    """Drive suspects again, twice as often from look to look, until all are decided or have had their runs.

    Who is decided in one measure goes on in the others. What is no worse than its margin by enough fresh runs
    is given up.
    """
    ends = looks(asked.most_runs)
    before = 0
    cells = matrix.plan.cells
    for end in ends:
        places: dict[CellSetting, list[int]] = {}
        undecided = {one.cell for one in matrix.suspects if one not in matrix.worse | matrix.given_up}
        for cell in (cells[number] for number in sorted(undecided)):
            places.setdefault(cell.setting, []).append(cell.place)
        if not places:
            return
        drive(run, matrix.plan, matrix.driving, places, CONFIRMATION, slice(before, end), asked.opponents)
        before = end
        p, no_sign = _fresh(matrix)
        found = discovered(p, rate_of_look(end, ends, asked.false_discovery_rate))
        matrix.worse |= {one for one, is_worse in zip(matrix.suspects, found, strict=True) if is_worse}
        if end >= TRIED_RUNS:
            matrix.given_up |= {one for one, none in zip(matrix.suspects, no_sign, strict=True) if none}


def _fresh(matrix: Matrix) -> tuple[Floats, NDArray[np.bool_]]:
    """The p-values of all suspects, and which are no worse than the margin, by their fresh runs alone."""
    cells = matrix.plan.cells
    p, no_sign = np.ones(len(matrix.suspects)), np.ones(len(matrix.suspects), np.bool_)
    for measure, (name, margin) in enumerate(matrix.margins.items()):
        here = [number for number, one in enumerate(matrix.suspects) if one.measure == measure]
        own = [cells[matrix.suspects[number].cell] for number in here]
        fresh = matrix.driving.differences(own, name, [CONFIRMATION])
        p[here] = p_worse(fresh, margin, mishap(matrix.driving.differences(cells, name), margin))
        no_sign[here] = no_worse(fresh, margin)
    return p, no_sign


def _report(run: Run, matrix: Matrix, config: Config, wall_s: float) -> MatrixReport:
    pair = next(iter(matrix.plan.pairs.values()))
    driven = matrix.driving.runs.values()
    measures = tuple(
        MatrixMeasure(
            name=name, unit=how.unit, relative=how.relative, less_is_better=how.kind == "time", margin=margin
        )
        for name, margin in matrix.margins.items()
        for how in [matrix.driving.measures[name]]
    )
    completed = matrix.driving.completed()
    lost = list(matrix.driving.void.values())
    idle = [name for name in config.matrix.margins if name not in matrix.margins]
    return MatrixReport(
        policy=pair.policy.name,
        policy_id=pair.policy.id,
        baseline=pair.baseline.name,
        baseline_id=pair.baseline.id,
        world=config.world,
        seed=config.seed,
        false_discovery_rate=config.matrix.false_discovery_rate,
        screening_runs=config.matrix.runs,
        runs=2 * sum(len(screening) + len(fresh) for screening, fresh in driven),
        starts=sum(one.starts for one in lost),
        policy_void=sum(one.policy for one in lost),
        baseline_void=sum(one.baseline for one in lost),
        policy_broken=completed.broken,
        baseline_broken=completed.others_broken,
        otherwise=run.otherwise,
        breaks_more=breaks_more(completed.alone, completed.other) >= 1 / config.matrix.false_discovery_rate,
        wall_s=round(wall_s, 1),
        versions=versions(),
        measures=measures,
        set_aside=(*matrix.plan.set_aside, *(f"{name}: nothing of the kind is measured" for name in idle)),
        levels=_level_reports(matrix, config.matrix.false_discovery_rate),
        cells=tuple(_cell_reports(matrix)),
    )


def _cell_reports(matrix: Matrix) -> Iterator[CellReport]:
    shrunk = [estimates(matrix, name) for name in matrix.margins]
    for number, cell in enumerate(matrix.plan.cells):
        findings = []
        for measure, name in enumerate(matrix.margins):
            mean, error = float(shrunk[measure].mean[number]), float(shrunk[measure].error[number])
            known = bool(np.isfinite(mean))
            policy, baseline = matrix.driving.marks(cell, name) if known else (None, None)
            findings.append(
                MatrixFinding(
                    worse=mean if known else None,
                    low=mean - COVERED * error if known else None,
                    high=mean + COVERED * error if known else None,
                    policy=policy,
                    baseline=baseline,
                    verdict=_said(Suspect(number, measure), matrix, mean),
                )
            )
        screening, fresh = matrix.driving.runs[cell]
        lost = matrix.driving.void[cell]
        yield CellReport(
            **cell.setting._asdict(),
            place=cell.place,
            runs=len(screening) + len(fresh),
            policy_void=lost.policy,
            baseline_void=lost.baseline,
            judged=not lost.hides,
            policy_broken=sum(one.broken[0] for one in (*screening, *fresh)),
            baseline_broken=sum(one.broken[1] for one in (*screening, *fresh)),
            findings=tuple(findings),
        )


def _level_reports(matrix: Matrix, rate: float) -> tuple[LevelReport, ...]:
    """All levels of the dimensions that have several, by the screening of their cells.

    No cell was left out there for how it looked.
    """
    cells, names = matrix.plan.cells, list(matrix.margins)
    differences = [matrix.driving.differences(cells, name, [SCREENING]) for name in names]
    mishaps = [
        mishap(table, margin) for table, margin in zip(differences, matrix.margins.values(), strict=True)
    ]
    found: list[tuple[str, str | int | float, list[Mean]]] = []
    p: list[float] = []
    for dimension, column in zip(DIMENSIONS, _columns(cells), strict=True):
        levels = list(dict.fromkeys(column))
        for level in levels if len(levels) > 1 else []:
            here = np.array([one == level for one in column])
            found.append((dimension, level, [mean_over_cells(table[here]) for table in differences]))
            p += [
                float(p_worse(as_one_cell(table[here]), matrix.margins[name], worst)[0])
                for name, table, worst in zip(names, differences, mishaps, strict=True)
            ]
    proven = iter(discovered(np.array(p), rate))
    return tuple(
        LevelReport(
            dimension=dimension,
            level=level,
            findings=tuple(_level_finding(mean, next(proven)) for mean in means),
        )
        for dimension, level, means in found
    )


def _level_finding(mean: Mean, is_worse: bool) -> MatrixFinding:
    if not mean.freedom:
        return MatrixFinding(worse=None, low=None, high=None, policy=None, baseline=None, verdict="no sign")
    return MatrixFinding(
        worse=mean.mean,
        low=mean.mean - COVERED * mean.error,
        high=mean.mean + COVERED * mean.error,
        policy=None,
        baseline=None,
        verdict="worse" if is_worse else "no sign",
    )


def _said(this: Suspect, matrix: Matrix, worse: float) -> Said:
    """What is said of a finding by which the policy is worse by so much."""
    if this in matrix.worse:
        return "worse"
    margin = list(matrix.margins.values())[this.measure]
    return "unconfirmed" if this in matrix.suspects and worse > margin else "no sign"

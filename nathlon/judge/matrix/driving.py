"""Driving cells: the same runs of policy and baseline, and how much worse the policy is in each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.match import TESTED, Match
from nathlon.arena.results import VOID_ENDINGS
from nathlon.arena.tested import BREAKDOWNS, entrant_rows
from nathlon.arena.voids import MOST
from nathlon.arena.world_registry import home
from nathlon.judge.matrix.cells import Cell, CellSetting, MatrixPlan
from nathlon.selection.battery.measures import Row, SkillMeasure, measured
from nathlon.selection.run import MATRIX, Run
from nathlon.selection.trials import against, draw_seeds
from nathlon.tournament.completion import Completed

SCREENING, CONFIRMATION = 0, 1
"""Which starts: what looked bad on some is confirmed on others."""
STOPPED = "stopped"
"""The measure that counts the runs which a policy does not complete."""
SEED = 3_305_117
"""Beside the configuration's, so that a matrix shares no start with a selection."""


class DrivenCell(NamedTuple):
    """A run of both in a cell.

    Attributes:
        matches: of the policy and of the baseline.
        race: its index in both.
        marks: by measure, of the policy and of the baseline; None where the run set none.
        broken: whether the policy broke down, and whether the baseline did.
    """

    matches: tuple[Match, Match]
    race: int
    marks: Mapping[str, tuple[float | None, float | None]]
    broken: tuple[bool, bool]


@dataclass
class Void:
    """Void runs of a cell.

    Attributes:
        starts: from which both have driven, or should have.
        policy, baseline: runs of each that are void.
    """

    starts: int = 0
    policy: int = 0
    baseline: int = 0

    @property
    def hides(self) -> bool:
        """Whether most runs of one of the two are void: the rest says nothing of it."""
        return max(self.policy, self.baseline) > MOST * self.starts


@dataclass
class Driving:
    """All runs so far.

    Attributes:
        measures: by name.
        runs: by cell, those of the screening and of the confirmation that are void for neither.
        void: by cell, those that are.
    """

    measures: Mapping[str, SkillMeasure]
    runs: dict[Cell, tuple[list[DrivenCell], list[DrivenCell]]] = field(default_factory=dict)
    void: dict[Cell, Void] = field(default_factory=dict)

    def differences(
        self, cells: Sequence[Cell], measure: str, phases: Iterable[int] = (SCREENING, CONFIRMATION)
    ) -> NDArray[np.float64]:
        """(cells, runs) how much worse the policy was, NaN where one of the two set no mark.

        Cells in which most runs of one of the two are void have nothing but NaN. Relative
        measures in shares of the baseline's mean mark in the cell.
        """
        how, phases = self.measures[measure], tuple(phases)
        rows: list[list[float]] = []
        for cell in cells:
            if self.void[cell].hides:
                rows.append([])
                continue
            base = self.marks(cell, measure)[1] if how.relative else 1.0
            rows.append(
                [
                    worse(how, one.marks[measure]) / abs(base) if base else float("nan")
                    for phase in phases
                    for one in self.runs[cell][phase]
                ]
            )
        table = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
        for row, values in zip(table, rows, strict=True):
            row[: len(values)] = values
        return table

    def completed(self) -> Completed:
        """How often the policy breaks down beside the baseline, over all runs of all cells."""
        broken = [one.broken for phases in self.runs.values() for runs in phases for one in runs]
        both, alone, other = (broken.count(two) for two in ((True, True), (True, False), (False, True)))
        return Completed(len(broken), both, alone, other)

    def marks(self, cell: Cell, measure: str) -> tuple[float | None, float | None]:
        """Mean marks of the policy and of the baseline in a cell, each over the runs in which it set one."""
        runs = [one.marks[measure] for phase in (SCREENING, CONFIRMATION) for one in self.runs[cell][phase]]
        policy, baseline = (_mean([pair[who] for pair in runs]) for who in (0, 1))
        return policy, baseline


def _mean(marks: Sequence[float | None]) -> float | None:
    known = [mark for mark in marks if mark is not None]
    return float(np.mean(known)) if known else None


def worse(how: SkillMeasure, marks: tuple[float | None, float | None]) -> float:
    """By how much the first mark is worse than the second, in their unit; NaN where one is missing."""
    policy, baseline = marks
    if policy is None or baseline is None:
        return float("nan")
    return policy - baseline if how.kind == "time" else baseline - policy


def begin(plan: MatrixPlan, measures: Iterable[str]) -> Driving:
    """Nothing driven yet.

    Raises:
        KeyError: if the world has no such measure.
    """
    world = home(next(iter(plan.pairs.values())).policy)
    return Driving(
        {name: measured(name, world) for name in measures},
        {cell: ([], []) for cell in plan.cells},
        {cell: Void() for cell in plan.cells},
    )


def drive(
    run: Run,
    plan: MatrixPlan,
    driving: Driving,
    places: Mapping[CellSetting, Sequence[int]],
    phase: int,
    runs: slice,
    opponents: Sequence[str],
) -> None:
    """Drive some starting places of some settings, and keep the runs.

    Args:
        run: has the matches run.
        plan: the matrix.
        driving: where the runs are kept.
        places: by setting.
        phase: `SCREENING` or `CONFIRMATION`.
        runs: which of each cell.
        opponents: who start from the other places; the world's baseline where there are none.
    """
    made: list[tuple[CellSetting, Sequence[int], tuple[Match, Match]]] = []
    for setting, here in places.items():
        pair = plan.pairs[setting.circuit, setting.car]
        rivals = opponents or (home(pair.policy).baseline,)
        drawn = [_seeds(run, setting, place, phase, runs) for place in here]
        seeds = [seed for starts in zip(*drawn, strict=True) for seed in starts]
        policy_match, baseline_match = (
            against(MATRIX, setting.raced, setting.raced, entrant, rivals, here, seeds) for entrant in pair
        )
        made.append((setting, here, (policy_match, baseline_match)))
    results = run.results(MATRIX, [match for _, _, both in made for match in both])
    frames = {str(key): frame for (key,), frame in results.partition_by("match", as_dict=True).items()}
    for setting, here, both in made:
        policy, baseline = (_marks(frames[match.key], driving.measures) for match in both)
        for race in range(len(both[0].races)):
            cell = Cell(setting, here[race % len(here)])
            lost = driving.void[cell]
            lost.starts += 1
            lost.policy += race not in policy
            lost.baseline += race not in baseline
            if race not in policy or race not in baseline:
                continue
            (policy_marks, policy_broke), (baseline_marks, baseline_broke) = policy[race], baseline[race]
            marks = {name: (policy_marks[name], baseline_marks[name]) for name in driving.measures}
            driving.runs[cell][phase].append(DrivenCell(both, race, marks, (policy_broke, baseline_broke)))


def _seeds(run: Run, setting: CellSetting, place: int, phase: int, runs: slice) -> list[int]:
    """The starts of a cell, which depend on nothing else in the matrix."""
    stream = np.random.SeedSequence([*run.seeds_from, SEED], spawn_key=(setting.number, place, phase))
    return draw_seeds(stream, runs.stop)[runs]


def _marks(
    results: pl.DataFrame, measures: Mapping[str, SkillMeasure]
) -> dict[int, tuple[dict[str, float | None], bool]]:
    """By race, the marks of the entrant tested and whether it broke down; void races are left out.

    Who breaks down sets no mark but in that: a run that ends early is compared with no other, and how often
    there is one is a measure of its own.
    """
    own: dict[int, Row] = {row["race"]: row for row in entrant_rows(results).iter_rows(named=True)}
    others: dict[int, list[Row]] = {race: [] for race in own}
    for row in results.filter(pl.col("team") != TESTED).iter_rows(named=True):
        others[row["race"]].append(row)
    void = set(results.filter(pl.col("ending").is_in(VOID_ENDINGS))["race"])
    found: dict[int, tuple[dict[str, float | None], bool]] = {}
    for race, tested in own.items():
        if race in void:
            continue
        broke = tested["ending"] in BREAKDOWNS
        marks = {
            name: how.mark(tested, others[race]) if name == STOPPED or not broke else None
            for name, how in measures.items()
        }
        found[race] = marks, broke
    return found

"""What a settings matrix says, as `matrix.json` says it to other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import polars as pl

from nathlon.results.part import ResultModel
from nathlon.sim.whole_file import whole_file, write_whole

VERSION = 1
"""Of `matrix.json`: raised when a field goes or changes its meaning, not when one is added."""

Said = Literal["worse", "unconfirmed", "no sign"]
NOT_JUDGED = 3
"""Exit code where a cell could not be judged, as most of its runs are void."""


class MatrixMeasure(ResultModel):
    """A measure.

    Attributes:
        name, unit: of the marks.
        relative: whether differences and margin are shares of the baseline's mark, or in `unit`.
        less_is_better: of the marks.
        margin: by which the policy may be worse.
    """

    name: str
    unit: str
    relative: bool
    less_is_better: bool
    margin: float


class MatrixFinding(ResultModel):
    """A cell in one measure.

    Attributes:
        worse: by how much the policy is worse, drawn towards what rows and columns of the matrix have in
            common; None where nothing was measured.
        low, high: 95 % interval.
        policy, baseline: mean marks.
        verdict: "worse" if runs on fresh starts prove it, at the false discovery rate; "unconfirmed" if it
            only looks so.
    """

    worse: float | None
    low: float | None
    high: float | None
    policy: float | None
    baseline: float | None
    verdict: Said


class CellReport(ResultModel):
    """A cell.

    Attributes:
        delay_s: with which all cars see, s.
        hz: actions a second of all cars; 0 for the scenario's own.
        blur, noise: before all cameras.
        runs: of policy and baseline, each, from starts from which neither is void.
        policy_void, baseline_void: runs of each that are void, and compared in nothing.
        judged: whether no more than half of either's runs are.
        policy_broken, baseline_broken: runs of these in which they broke down, which are compared in nothing
            else.
        findings: in the order of the report's measures.
        replay: path, beside the report, of the page with the worst run.
    """

    circuit: str
    car: str
    scenario: str
    compound: str
    delay_s: float
    hz: float = 0.0
    blur: int = 0
    noise: float = 0.0
    place: int
    runs: int
    policy_void: int = 0
    baseline_void: int = 0
    judged: bool = True
    policy_broken: int = 0
    baseline_broken: int = 0
    findings: tuple[MatrixFinding, ...]
    replay: str | None = None

    @property
    def verdict(self) -> Said:
        """The gravest of its findings."""
        said = {finding.verdict for finding in self.findings}
        return "worse" if "worse" in said else "unconfirmed" if "unconfirmed" in said else "no sign"

    @property
    def label(self) -> str:
        """The cell in words."""
        parts = [self.scenario, f"place {self.place}", self.circuit, self.car, self.compound]
        seen = (
            (self.delay_s, f"{self.delay_s:g} s late"),
            (self.hz, f"{self.hz:g} Hz"),
            (self.blur, f"blur {self.blur}"),
            (self.noise, f"noise {self.noise:g}"),
        )
        return ", ".join(filter(None, [*parts, *(words for value, words in seen if value)]))


class LevelReport(ResultModel):
    """All cells of a circuit, a car, a scenario, a compound, a delay or a place together.

    Attributes:
        dimension: field of a cell.
        level: its value.
        findings: of the screening, in the order of the report's measures: means over the cells, not drawn
            towards anything; without marks.
    """

    dimension: str
    level: str | int | float
    findings: tuple[MatrixFinding, ...]


class MatrixReport(ResultModel):
    """All that a matrix says.

    Attributes:
        false_discovery_rate: the share, to be expected, of findings called worse that are not.
        screening_runs: of policy and baseline in every cell.
        runs: that are compared, in all.
        starts: from which policy and baseline have driven, or should have.
        policy_void, baseline_void: runs from these that are void, of each.
        policy_broken, baseline_broken: of the half of `runs` of each, those in which it broke down.
        breaks_more: whether the policy surely does so more often, from the same starts.
        set_aside: sentences on what could not be driven.
        otherwise: that an episode came out otherwise when it was played again, in a sentence.
    """

    policy: str
    policy_id: str
    baseline: str
    baseline_id: str
    world: str
    seed: int
    false_discovery_rate: float
    screening_runs: int
    runs: int
    starts: int = 0
    policy_void: int = 0
    baseline_void: int = 0
    policy_broken: int = 0
    baseline_broken: int = 0
    breaks_more: bool = False
    otherwise: str = ""
    wall_s: float
    versions: dict[str, str]
    measures: tuple[MatrixMeasure, ...]
    set_aside: tuple[str, ...]
    levels: tuple[LevelReport, ...]
    cells: tuple[CellReport, ...]
    version: int = VERSION

    @property
    def worse(self) -> int:
        """Number of cells in which the policy is worse."""
        return sum(cell.verdict == "worse" for cell in self.cells)

    @property
    def headline(self) -> str:
        """What it comes to."""
        cells = "1 cell" if len(self.cells) == 1 else f"{len(self.cells):,} cells"
        more = " It breaks down more often." if self.breaks_more else ""
        if self.not_judged == len(self.cells):
            return f"{self.policy} could not be judged beside {self.baseline}: most runs are void.{more}"
        if self.not_judged:
            more = f" {self.not_judged:,} could not be judged: most of their runs are void.{more}"
        if not self.worse:
            return f"{self.policy} is nowhere proven to be worse than {self.baseline}: {cells}.{more}"
        return f"{self.policy} is worse than {self.baseline} in {self.worse:,} of {cells}.{more}"

    @property
    def not_judged(self) -> int:
        """Number of cells in which most runs of policy or baseline are void."""
        return sum(not cell.judged for cell in self.cells)

    @property
    def exit_code(self) -> int:
        """0, or 3 if a cell could not be judged."""
        return NOT_JUDGED if self.not_judged else 0

    @property
    def void_runs(self) -> str:
        """How many runs are void, and whose; empty where none are."""
        if not self.policy_void + self.baseline_void:
            return ""
        return (
            f"{self.policy_void:,} of {self.starts:,} runs of {self.policy} and {self.baseline_void:,} of "
            f"{self.baseline} are void: these starts are compared in nothing."
        )

    @property
    def completion(self) -> str:
        """How often both broke down, and what such runs count for; empty where they never did."""
        if not self.policy_broken + self.baseline_broken:
            return ""
        return (
            f"{self.policy} broke down in {self.policy_broken:,} of {self.runs // 2:,} runs, {self.baseline} "
            f"in {self.baseline_broken:,}: runs that both completed are compared, and how often they stopped."
        )

    def severity(self, cell: CellReport) -> tuple[int, float]:
        """For the order: how grave the verdict is, and by how many margins the policy is worse."""
        rank = ("no sign", "unconfirmed", "worse").index(cell.verdict)
        excess = [
            finding.worse / max(measure.margin, finding.high - finding.worse, 1e-12)
            for finding, measure in zip(cell.findings, self.measures, strict=True)
            if finding.verdict == cell.verdict and finding.worse is not None and finding.high is not None
        ]
        return rank, max(excess, default=float("-inf"))

    def ordered(self) -> list[CellReport]:
        """Cells, what got worse first."""
        return sorted(self.cells, key=self.severity, reverse=True)

    def frame(self) -> pl.DataFrame:
        """One row a cell and measure, what got worse first."""
        rows = [
            cell.model_dump(exclude={"findings", "replay"})
            | {"measure": measure.name, "unit": "share" if measure.relative else measure.unit}
            | finding.model_dump()
            for cell in self.ordered()
            for measure, finding in zip(self.measures, cell.findings, strict=True)
        ]
        return pl.DataFrame(rows, infer_schema_length=None)


def write_matrix(report: MatrixReport, folder: Path) -> Path:
    """Write `matrix.json` and `matrix.csv` to a folder, each whole or not at all; the path of the first."""
    path = folder / "matrix.json"
    write_whole(path, report.model_dump_json(indent=1))
    with whole_file(folder / "matrix.csv") as partial:
        report.frame().write_csv(partial)
    return path

"""`nathlon.gate`: whether candidates may take the champion's place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path

import polars as pl

from nathlon.api.candidates import Candidate, Candidates, named_sources, one_source
from nathlon.api.selection import configured, entered
from nathlon.arena.decision import Decision
from nathlon.arena.entrance import endings_of
from nathlon.arena.pool import Pool
from nathlon.judge.gate.gate import run_gate
from nathlon.policies.sources.finding import Found
from nathlon.reports.gate import write_gate
from nathlon.reports.gate_page import write_gate_page
from nathlon.results.gate import GateReport
from nathlon.selection.config import Config
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.run import GATE, KERNELS, TIMES
from nathlon.selection.single_run import single_run
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import check_output
from nathlon.terminal.progress import stage_progress, worker_count


class GateResult:
    """What a gate came to, and where it has left everything.

    Attributes:
        folder: of all that it has left: `gate.json`, `gate.md`, `junit.xml`, `index.html`, `store.sqlite`.
        report: what `gate.json` holds.
        sources: of the candidates, on this machine.
    """

    def __init__(self, folder: Path, report: GateReport, sources: Sequence[str]) -> None:
        self.folder, self.report, self.sources = folder, report, sources

    @property
    def verdict(self) -> Decision:
        """Of all candidates together: pass, fail or cannot tell."""
        return self.report.verdict

    @property
    def passed(self) -> list[str]:
        """Names of the candidates that may take the champion's place."""
        return [candidate.name for candidate in self.report.candidates if candidate.verdict == Decision.PASS]

    @property
    def findings(self) -> pl.DataFrame:
        """One row a candidate and measure: the fields of `nathlon.results.gate.GateFinding` after `name`."""
        rows = [
            {"name": candidate.name} | finding.model_dump(mode="json")
            for candidate in self.report.candidates
            for finding in candidate.findings
        ]
        return pl.DataFrame(rows, infer_schema_length=None)

    def __repr__(self) -> str:
        lines = [self.report.headline, *self.report.remarks]
        for candidate in self.report.candidates:
            lines += [f"{candidate.name}: {finding.sentence}" for finding in candidate.findings]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        shown = self.findings.select("name", "measure", "verdict", "difference", "low", "high", "margin")
        return f"<h3>{escape(self.report.headline)}</h3>" + shown._repr_html_()


def gate(
    candidates: Candidates,
    champion: Candidate,
    out: str | Path = "runs/gate",
    *,
    config: Config | str | Path | None = None,
    seed: int | None = None,
    workers: int | None = None,
    world: str | None = None,
    loader: str | None = None,
    progress: bool = True,
) -> GateResult:
    """Whether candidates are no worse than the champion by more than the margins of a configuration.

    They race it in mirrored pairs, and drive the same time trials and skill tests, until every measure is
    decided or the budget is spent. The same call goes on with a gate that was stopped.

    Args:
        candidates: checkpoints, folders of them, `plugin:NAME` or objects; each is judged by itself.
        champion: whose place they would take.
        out: folder for everything that the gate leaves; it may be that of earlier gates.
        config: whose section `gate` has margins and budget, or the path of a `nathlon.toml`.
        seed, workers: instead of the configuration's.
        world: the simulator, instead of the configuration's.
        loader: as of `nathlon.select`.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if a policy cannot drive, a candidate is the champion, a name or file is wrong, or the
            folder cannot be written.
    """
    settings = configured(config, seed, workers=workers, world=world, loader=loader)
    check_output(Path(out))
    with Pool(worker_count(settings.workers)) as pool:
        endings = endings_of(pool, settings.world)
        reference = one_source(champion, endings=endings)
        sources = named_sources(candidates, endings=endings)
        given = [reference, *sources]
        field, settings = entered(pool, Found(given, set(given)), settings)
        first, *others = together = field.newcomers
        if reference in sources:
            first = replace(first, also=(reference, *first.also))
        if not others:
            raise InputError(f"{', '.join(first.also)}: is the champion itself, expected another policy")
        output = OutputFolder(Path(out))
        with (
            stage_progress(progress, (KERNELS, "battery", GATE, TIMES)) as on_match,
            single_run(GATE, together, settings, output.store, pool, on_match) as run,
        ):
            report = run_gate(run, first, others, settings)
        with output.filling():
            write_gate(report, output.root)
            write_gate_page(report, output.root)
    return GateResult(output.root, report, sources)

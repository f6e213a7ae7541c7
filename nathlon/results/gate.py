"""What a gate says, as `gate.json` has it."""

from __future__ import annotations

from nathlon.arena.decision import Decision
from nathlon.results.part import ResultModel
from nathlon.results.voided import Voided
from nathlon.sim.names import printable

VERSION = 1
"""Of `gate.json`: raised when a field goes or changes its meaning, not when one is added."""

EXIT_CODES = {Decision.PASS: 0, Decision.FAIL: 1, Decision.CANNOT_TELL: 4}
NOT_JUDGED = 3
"""Exit code where nobody fails, but somebody could not be judged, as most of its runs are void."""


class GateFinding(ResultModel):
    """One measure of a candidate less the champion's, turned so that more is better.

    Attributes:
        measure, unit: what was measured.
        margin: by which the candidate may be worse; None of what is counted and not compared.
        difference: observed; None where nothing was.
        low, high: bounds that hold at all looks together; None where they are not known.
        note: a sentence on what the verdict rests on, or does not; empty where there is nothing to say.
        units: of evidence: mirrored pairs of races, or runs.
        most: units that the budget allowed.
        void: units that count for nobody.
        needed: units that would decide, if the difference stays as it is; None where that is not known.
        verdict: on this measure alone.
        set_aside: why it was not asked, if it was not.
        counted: what the units of something are that is not compared with the champion's.
    """

    measure: str
    unit: str
    margin: float | None
    difference: float | None = None
    low: float | None = None
    high: float | None = None
    units: int = 0
    most: int = 0
    void: int = 0
    needed: int | None = None
    verdict: Decision = Decision.CANNOT_TELL
    set_aside: str | None = None
    note: str = ""
    counted: str = "runs"

    @property
    def bounds(self) -> str:
        """Its bounds in words; completion has a lower one alone."""
        if self.low is None:
            return ""
        return (
            f"{self.low:+z.3g} to {self.high:+z.3g}" if self.high is not None else f"{self.low:+z.3g} or more"
        )

    @property
    def sentence(self) -> str:
        """It in words."""
        if self.set_aside is not None:
            return f"{self.measure}: not asked: {self.set_aside}"
        if self.margin is None:
            found = "not known" if self.difference is None else f"{self.difference:g}"
            said = f"{self.measure}: {found} in {self.units:,} {self.counted}"
        elif self.difference is None:
            said = f"{self.measure} {self.unit}: not judged"
        else:
            bounds = f" ({self.bounds})" if self.bounds else ""
            said = (
                f"{self.measure} {self.unit}: {self.difference:+z.3g}{bounds}, "
                f"may be {-self.margin:+z.3g}; {self.units} of {self.most} units"
            )
        return f"{said}; {self.note}" if self.note else said


class Gated(ResultModel):
    """A candidate and what the gate says of it.

    Attributes:
        not_judged: it, or the champion beside it, where most of their units are void.
        also: other files with the same contents.
        other_gates: of it against the champion that the store holds, with other seeds or settings.
    """

    name: str
    entrant: str
    verdict: Decision
    findings: tuple[GateFinding, ...]
    not_judged: tuple[Voided, ...] = ()
    also: tuple[str, ...] = ()
    other_gates: int = 0

    @property
    def notes(self) -> list[str]:
        """What its findings rest on, or do not, measure by measure."""
        notes = [f"{finding.measure}: {finding.note}" for finding in self.findings if finding.note]
        if self.other_gates:
            notes.append(
                f"other gates: the store holds {self.other_gates} of the same two with other seeds or "
                "settings, and of several one passes by chance more often than alpha says"
            )
        return notes


class GateReport(ResultModel):
    """All that a gate says.

    Attributes:
        alpha: probability to pass a candidate that is worse by a margin.
        beta: probability, in each measure, to fail one that is as good.
        races: that it rests on, void ones included.
        void: races that count for nobody.
        champion_faults, champion_runs: runs of the champion's cars that ended by its own fault, and all.
        champion_also: candidates that were left out, as they are the champion's own file.
        otherwise: that an episode came out otherwise when it was played again, in a sentence.
        wall_s: how long it took.
    """

    champion: str
    champion_id: str
    circuit: str
    car: str
    world: str
    seed: int
    alpha: float
    beta: float
    races: int
    wall_s: float
    versions: dict[str, str]
    candidates: tuple[Gated, ...]
    void: int = 0
    champion_faults: int = 0
    champion_runs: int = 0
    champion_also: tuple[str, ...] = ()
    otherwise: str = ""
    version: int = VERSION

    @property
    def verdict(self) -> Decision:
        """Of all candidates together."""
        said = [candidate.verdict for candidate in self.candidates]
        return next((v for v in (Decision.FAIL, Decision.CANNOT_TELL) if v in said), Decision.PASS)

    @property
    def exit_code(self) -> int:
        """0 if all candidates pass, 1 if one fails; else 3 if one could not be judged, 4 if one is open."""
        if self.verdict == Decision.CANNOT_TELL and any(one.not_judged for one in self.candidates):
            return NOT_JUDGED
        return EXIT_CODES[self.verdict]

    @property
    def headline(self) -> str:
        """The verdicts in a sentence."""
        return " ".join(map(self._said, self.candidates))

    def _said(self, candidate: Gated) -> str:
        if candidate.verdict == Decision.CANNOT_TELL and candidate.not_judged:
            void = " and ".join(dict.fromkeys(one.name for one in candidate.not_judged))
            return (
                f"{candidate.name} could not be judged beside {self.champion}: most runs of {void} are void."
            )
        said = {
            Decision.PASS: "may replace",
            Decision.FAIL: "may not replace",
            Decision.CANNOT_TELL: "may or may not be as good as",
        }
        return f"{candidate.name} {said[candidate.verdict]} {self.champion}."

    @property
    def remarks(self) -> list[str]:
        """What else stands beside the verdicts, in sentences."""
        told = []
        if self.void:
            told.append(f"{self.void:,} of {self.races:,} races are void and count for nobody.")
        if self.champion_faults:
            told.append(
                f"{self.champion} itself ended {self.champion_faults:,} of {self.champion_runs:,} runs by "
                "its own fault."
            )
        told += [
            f"Same file as {one.name}: {', '.join(map(printable, one.also))}."
            for one in self.candidates
            if one.also
        ]
        if self.champion_also:
            left = ", ".join(map(printable, self.champion_also))
            told.append(f"Same file as the champion {self.champion}, left out: {left}.")
        return [*told, self.otherwise] if self.otherwise else told

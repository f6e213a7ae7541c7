"""Candidates: formulas that were proposed, what became of them, and what proposers are told of it."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from nathlon.lab.reward.alignment import Alignment
from nathlon.sim.data_file import Section


class Gene(Section):
    """A term of a formula that was put together.

    Attributes:
        term: one of `nathlon.lab.reward.sampling.TERMS`.
        weight: how much it counts.
        distance: its distance, m, if it has one.
    """

    term: str
    weight: float
    distance: float = 0.0


class Proposal(Section):
    """A formula as it was proposed.

    Attributes:
        formula: text of an expression.
        why: what the proposer says of it.
        genes: what it was put together of, if it was.
    """

    formula: str
    why: str = ""
    genes: tuple[Gene, ...] = ()


class Candidate(Proposal):
    """A formula that was tried.

    Attributes:
        name: `2.7` is the seventh of the second round.
        factor: by which it is multiplied for training, so that all candidates are of one scale.
        alignment: with the preferences so far; None if it was refused.
        refused: why it was not tried at all; empty if it was.
        kept: whether it was trained.
        failed: why its training came to nothing; empty if it did not.
    """

    name: str
    factor: float = 1.0
    alignment: Alignment | None = None
    refused: str = ""
    kept: bool = False
    failed: str = ""

    @property
    def scaled(self) -> str:
        """The formula of the training."""
        return f"{self.factor:.6g} * ({self.formula})"


class CandidateOutcome(Section):
    """What a trained candidate does.

    Attributes:
        strength: Bradley and Terry's, log-odds, among those it was compared with.
        measured: `nathlon.lab.reward.measures.MEASURES`, means of its clips.
        lap_s: mean of four time trials; None unless all were completed.
        lap_off_course: share of the time off course in these.
        checkpoint: its last one, from the folder of the design.
    """

    candidate: Candidate
    strength: float
    measured: dict[str, float]
    lap_s: float | None
    lap_off_course: float
    checkpoint: str


class Brief(NamedTuple):
    """What a proposer is told.

    Attributes:
        task: in words.
        number: of the round, from 1.
        attempt: how often it has been asked in this round, from 0.
        wanted: how many formulas.
        outcomes: of the round before and the best so far, the best first; empty at first.
        remarks: of judges.
        refused: formulas of this round with why they were thrown out.
    """

    task: str
    number: int
    attempt: int
    wanted: int
    outcomes: tuple[CandidateOutcome, ...] = ()
    remarks: tuple[str, ...] = ()
    refused: tuple[tuple[str, str], ...] = ()


class Proposer(Protocol):
    """Proposes formulas."""

    def propose(self, brief: Brief) -> list[Proposal]:
        """Some formulas, at most as many as wanted; they need not be any good.

        Raises:
            InputError: if it cannot be asked.
        """

"""The proposer without a model: formulas put together of terms, and bred from the best of the round before.

It does not read the task: what is asked for comes in through the judge alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nathlon.lab.reward.candidates import Brief, Gene, Proposal

FRESH = 5
"""Of so many formulas one is new, also when there are some to breed from."""
STEP, STEP_APART = 0.5, 0.15
"""How far weights and distances move when they are bred: spread of their logarithms."""
ADDED, DROPPED, MOVED = 0.5, 0.3, 0.1
"""How often a term is added, dropped, and the way in which progress counts changes."""
SECOND = 0.3
"""How often the second best is bred from."""


class Term(NamedTuple):
    """A term of a formula.

    Attributes:
        text: a pure number; {d} stands for a distance.
        sign: whether it pays or costs.
        weights: between which it is drawn, by its logarithm, beside metres of progress.
        apart_m: the same of the distance.
    """

    text: str
    sign: str
    weights: tuple[float, float]
    apart_m: tuple[float, float] | None = None


BASES: dict[str, str] = {
    "progress": "progress / m",
    "progress on course": "progress / m * (off_course == 0)",
    "speed along": "speed * step / m * cos(heading_error)",
}
"""What pays for driving; every formula has one, of weight 1."""
TERMS: dict[str, Term] = {
    "off course": Term("off_course / s", "-", (3.0, 300.0)),
    "off course at speed": Term("off_course * speed_before ** 2 * s / m ** 2", "-", (0.003, 0.3)),
    "tyres out": Term("out", "-", (0.03, 3.0)),
    "kerbs": Term("kerb", "-", (0.005, 0.5)),
    "edge": Term("(edge < {d} * m)", "-", (0.03, 3.0), (0.1, 1.5)),
    "wall": Term("wall / s", "-", (3.0, 300.0)),
    "wall at speed": Term("wall * speed_before ** 2 * s / m ** 2", "-", (0.02, 1.0)),
    "touching": Term("touching", "-", (0.3, 30.0)),
    "contacts": Term("contacts", "-", (1.0, 100.0)),
    "contacts at fault": Term("contacts_at_fault", "-", (1.0, 100.0)),
    "near": Term("(nearest < {d} * m)", "-", (0.05, 3.0), (3.0, 8.0)),
    "running up": Term(
        "(gap_ahead < {d} * m) * max(closing_ahead, 0) * s / m", "-", (0.02, 1.0), (6.0, 15.0)
    ),
    "passing": Term("(gap_ahead < {d} * m) * closing_ahead * step / m", "+", (0.2, 2.0), (20.0, 40.0)),
    "being passed": Term("(gap_behind < {d} * m) * closing_behind * step / m", "-", (0.2, 2.0), (10.0, 20.0)),
    "steering": Term("(steering_rate * s) ** 2", "-", (0.003, 0.3)),
    "slip": Term("tyre_slip", "-", (0.05, 5.0)),
}


class Sampler:
    """Proposes formulas from a seed.

    Args:
        seed: of all that is drawn.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def propose(self, brief: Brief) -> list[Proposal]:
        """As many formulas as are wanted."""
        rng = np.random.default_rng([self._seed, 2, brief.number, brief.attempt])
        parents = [one.candidate for one in brief.outcomes if one.candidate.genes][:2]
        found = []
        for index in range(brief.wanted):
            if parents and index % FRESH:
                parent = parents[-1] if rng.random() < SECOND else parents[0]
                genes, why = _bred(parent.genes, rng), f"bred from {parent.name}"
            else:
                genes, why = _drawn(rng), "drawn"
            found.append(Proposal(formula=written(genes), why=why, genes=genes))
        return found


def written(genes: tuple[Gene, ...]) -> str:
    """The formula of some terms, of which the first is one of BASES."""
    base, *others = genes
    parts = [BASES[base.term]]
    for gene in others:
        term = TERMS[gene.term]
        parts.append(f"{term.sign} {gene.weight:.3g} * {term.text.format(d=f'{gene.distance:.2g}')}")
    return " ".join(parts)


def _drawn(rng: np.random.Generator) -> tuple[Gene, ...]:
    count = int(rng.integers(2, 7))
    names = rng.choice(list(TERMS), count, replace=False)
    return (_base(rng), *(_gene(str(name), rng) for name in names))


def _base(rng: np.random.Generator) -> Gene:
    return Gene(term=str(rng.choice(list(BASES))), weight=1.0)


def _gene(name: str, rng: np.random.Generator) -> Gene:
    term = TERMS[name]
    distance = _between(term.apart_m, rng) if term.apart_m else 0.0
    return Gene(term=name, weight=_between(term.weights, rng), distance=distance)


def _between(bounds: tuple[float, float], rng: np.random.Generator) -> float:
    low, high = bounds
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _bred(genes: tuple[Gene, ...], rng: np.random.Generator) -> tuple[Gene, ...]:
    base, *others = genes
    if rng.random() < MOVED:
        base = _base(rng)
    if len(others) > 1 and rng.random() < DROPPED:
        others.pop(int(rng.integers(len(others))))
    others = [
        one.model_copy(
            update={
                "weight": one.weight * math.exp(rng.normal(0.0, STEP)),
                "distance": one.distance * math.exp(rng.normal(0.0, STEP_APART)),
            }
        )
        for one in others
    ]
    missing = [name for name in TERMS if name not in {one.term for one in others}]
    if missing and rng.random() < ADDED:
        others.append(_gene(str(rng.choice(missing)), rng))
    return (base, *others)

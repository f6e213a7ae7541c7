"""A design as its page shows it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from nathlon.arena.recorder import outline, stretches
from nathlon.lab.reward.alignment import Preference
from nathlon.lab.reward.candidates import Candidate, CandidateOutcome
from nathlon.lab.reward.clips import OTHERS
from nathlon.lab.reward.design import FINAL, FINALLY, LIBRARY, PREFERRED, Design
from nathlon.lab.reward.library import DRIVER
from nathlon.lab.reward.records import JUDGED, read_record
from nathlon.lab.reward.trying import curve
from nathlon.policies.checkpoint import read_checkpoint
from nathlon.reports.race_data import circuit_data
from nathlon.reports.reward_page import CurvePoint, RewardDrawing, RoundShown, Shown
from nathlon.sim.track import load_track

MOST_STARTS = 4
"""Clips of everybody that are in the page."""
PROPOSERS = {"embedded": "the embedded sampler", "model": "a language model"}
JUDGES = {"rule": "the rule", "people": "people", "model": "a language model that looks at pictures"}


def drawing(design: Design) -> RewardDrawing:
    """All that its page shows, as far as it has come."""
    settings, training = design.settings, design.settings.training
    track = load_track(training.circuit)
    facts = [
        (training.circuit, training.car),
        ("proposed by", PROPOSERS[settings.proposer]),
        ("judged by", f"{JUDGES[settings.judge]}{f', {settings.rule}' if settings.judge == 'rule' else ''}"),
        ("trained for", f"{settings.updates:,} updates, in the end {settings.final_updates:,}"),
        ("seed", str(settings.seed)),
    ]
    final = design.final
    shown = [FINALLY] if final else []
    shown += [one.candidate.name for came in reversed(design.outcomes) for one in came]
    clips = {name: design.clips[name].drawn[:MOST_STARTS] for name in dict.fromkeys([*shown, DRIVER])}
    return RewardDrawing(
        task=settings.task,
        facts=tuple(facts),
        preferences=len(read_record(design.folder / LIBRARY / PREFERRED, JUDGED).preferences),
        rounds=tuple(_round(design, number) for number in range(1, len(design.outcomes) + 1)),
        winner=_outcome(final, _curve(design.folder / FINAL)) if final else None,
        checkpoint=final.checkpoint if final else "",
        card=_card(design.folder / final.checkpoint) if final else (),
        circuit=circuit_data(outline(track), stretches(track)),
        clips=clips,
        car=len(OTHERS),
    )


def _round(design: Design, number: int) -> RoundShown:
    candidates, outcomes = design.rounds[number - 1], design.outcomes[number - 1]
    trained = []
    for one in outcomes:
        name = one.candidate.name
        home = design.folder / f"round-{name.partition('.')[0]}" / name
        trained.append(_outcome(one, _curve(home), carried=not name.startswith(f"{number}.")))
    others = [_candidate(one) for one in candidates if not one.kept or one.failed]
    left = sorted((one for one in others if one.tac is not None), key=lambda one: -(one.tac or 0.0))
    judged = read_record(design.folder / f"round-{number}" / PREFERRED, JUDGED).preferences
    names = [one.name for one in trained]
    return RoundShown(
        number,
        tuple(trained),
        tuple(left),
        tuple(one for one in others if one.tac is None),
        _wins(names, judged),
        _remarks(judged) if design.settings.judge != "rule" else (),
    )


def _candidate(one: Candidate) -> Shown:
    alignment = one.alignment
    return Shown(
        one.name,
        one.formula,
        one.why,
        tac=alignment.tac if alignment else None,
        error=alignment.error if alignment else None,
        refused=one.refused or one.failed,
    )


def _outcome(one: CandidateOutcome, curve: tuple[CurvePoint, ...], carried: bool = False) -> Shown:
    return _candidate(one.candidate)._replace(
        curve=curve, strength=one.strength, measured=one.measured, lap_s=one.lap_s, carried=carried
    )


def _curve(folder: Path) -> tuple[CurvePoint, ...]:
    return tuple(
        CurvePoint(one.updates, None if math.isnan(one.lap_s) else one.lap_s, one.off_course_share)
        for one in curve(folder)
    )


def _wins(names: Sequence[str], judged: Sequence[Preference]) -> tuple[tuple[float | None, ...], ...]:
    rows: list[list[float | None]] = [[None if row == column else 0.0 for column in names] for row in names]
    for one in judged:
        first, second = names.index(one.first), names.index(one.second)
        for row, column, share in (
            (first, second, 0.5 + 0.5 * one.better),
            (second, first, 0.5 - 0.5 * one.better),
        ):
            rows[row][column] = (rows[row][column] or 0.0) + share
    return tuple(map(tuple, rows))


def _remarks(judged: Sequence[Preference]) -> tuple[str, ...]:
    signs = {1: ">", -1: "<", 0: "="}
    return tuple(
        f"{one.first} {signs[one.better]} {one.second} from start {one.start + 1}: {one.remark}"
        for one in judged
        if one.remark
    )


def _card(checkpoint: Path) -> tuple[tuple[str, str], ...]:
    card: Any = read_checkpoint(checkpoint)[0]
    return (
        ("algorithm", card.algorithm),
        ("circuit", card.circuit),
        ("car", card.car),
        ("updates", f"{card.step:,}"),
        ("transitions", f"{card.transitions:,}"),
        ("seed", str(card.seed)),
    )

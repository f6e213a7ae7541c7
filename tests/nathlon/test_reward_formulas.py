"""Formulas of rewards: which are thrown out, how well they agree with preferences, who proposes them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from scipy.stats import kendalltau

from nathlon.lab.reward.alignment import Preference, align, returns, tau_a
from nathlon.lab.reward.candidates import Brief, Candidate, CandidateOutcome
from nathlon.lab.reward.judging import ClipQuestion, JudgingRule, read_verdict
from nathlon.lab.reward.library import DRIVER
from nathlon.lab.reward.measures import MEASURES, measure
from nathlon.lab.reward.ranking import all_pairs, some_pairs, strengths
from nathlon.lab.reward.sampling import BASES, TERMS, Sampler
from nathlon.lab.reward.vetting import vet
from nathlon.lab.reward.wording import messages, read_reply
from nathlon.sim.errors import InputError
from nathlon.sim.expressions import pure_number
from nathlon.sim.instruments import QUANTITIES
from tests.support.reward_designs import STEPS, TASK, made_up, made_up_library

STEP_S = 0.1


@pytest.mark.parametrize(
    ("formula", "reason"),
    [
        ("3 + 0 * progress / m", "is constant"),
        ("min(progress / m, 0) * 0", "is constant"),
        ("progress / m - 100000 * contacts", "explodes: a step .* brings"),
        ("1 - progress / m", "pays for standing still: 1 a step"),
        ("speed / (m/s) * 0 + (nearest > 100 * m)", "pays for standing still"),
        # Less is lost at rest, where the run ends after five seconds, than by driving on for good.
        ("0.01 * progress / m - 1", "pays for standing still"),
        ("progress", "is in m, expected a pure number"),
        ("progress / speed", "divides by what may be 0"),
        ("__import__('os').system('true')", "means nothing here"),
        ("happiness", "is no quantity"),
        ("exp(speed / (m/s))", "may be as large as|expected"),
    ],
)
def test_what_cannot_be_learnt_from_is_thrown_out(formula: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        vet(formula, made_up_library(), 0.99, STEP_S)


def test_formulas_of_any_scale_are_trained_alike() -> None:
    library = made_up_library()
    small, large = (vet(f"{scale} * progress / m", library, 0.99, STEP_S) for scale in (0.001, 400))
    assert small.factor * 0.001 == pytest.approx(400 * large.factor) == pytest.approx(1 / 4.5)
    # What is lost by driving on may be dear, if more is lost at rest.
    vet("progress / m - 6", library, 0.99, STEP_S)


def test_tau_a_is_that_of_all_pairs() -> None:
    rng = np.random.default_rng(5)
    value, wanted = rng.permutation(30), rng.permutation(30)
    rows, columns = np.triu_indices(30, 1)
    orders = list(
        zip(np.sign(value[rows] - value[columns]), np.sign(wanted[rows] - wanted[columns]), strict=True)
    )
    assert tau_a(orders).tac == pytest.approx(kendalltau(value, wanted).statistic)
    assert tau_a([(1, 1), (1, -1), (0, 1), (1, 0)])[:2] == pytest.approx((0.0, np.sqrt(0.5) / 2))


def test_a_formula_agrees_with_who_thinks_so() -> None:
    clips = made_up_library()
    prefers = [
        Preference(first=DRIVER, second="wild", start=0, better=1),
        Preference(first="rude", second=DRIVER, start=1, better=-1),
        Preference(first="still", second="wild", start=0, better=-1),
    ]
    pace = pure_number("progress / m", QUANTITIES)
    assert returns(pace, clips["wild"]) == pytest.approx(4.8 * STEPS)
    assert align(pace, clips, prefers).tac == pytest.approx(-1 / 3)
    fair = pure_number("progress / m - 50 * off_course / s - 100 * contacts", QUANTITIES)
    assert align(fair, clips, prefers).tac == 1.0


def test_only_what_was_driven_counts() -> None:
    clips = made_up("short", progress=4.0)
    clips.driven[0, STEPS // 2 :] = False
    assert returns(pure_number("progress / m", QUANTITIES), clips).tolist() == [2.0 * STEPS, 4.0 * STEPS]


def test_the_rule_sees_what_was_measured() -> None:
    clips = made_up_library()
    [first, _] = measure(clips["wild"], clips[DRIVER], STEP_S)
    assert first == {name: pytest.approx(first[name]) for name in MEASURES}
    assert (first["pace"], first["pace_share"], first["off_course"]) == pytest.approx((48.0, 4.8 / 4.5, 0.25))
    found: list[Preference] = []
    pairs = all_pairs(["wild", DRIVER, "still"], 2, 2, np.random.default_rng(1))
    JudgingRule("pace_share - 2 * off_course", STEP_S).judge(
        ClipQuestion("q", TASK, clips, clips[DRIVER], pairs), found.append
    )
    strength = strengths(["wild", DRIVER, "still"], found)
    assert sorted(strength, key=lambda name: strength[name]) == ["still", "wild", DRIVER]
    with pytest.raises(InputError, match="no quantity"):
        JudgingRule("charm", STEP_S)


def test_pairs_are_those_of_the_same_start_and_none_twice() -> None:
    pairs = some_pairs(made_up_library(), 1000, np.random.default_rng(0))
    assert len(pairs) == len({frozenset((one.first, one.second, str(one.start))) for one in pairs}) == 6 * 2


def test_all_terms_of_the_sampler_are_formulas() -> None:
    for base in BASES.values():
        assert pure_number(base, QUANTITIES)
    for term in TERMS.values():
        assert pure_number(term.text.format(d=5), QUANTITIES)


def brief(**other: Any) -> Brief:
    return Brief(TASK, 2, 0, 20)._replace(**other)


def outcome(proposal: object, name: str = "1.3", strength: float = 1.0) -> CandidateOutcome:
    candidate = Candidate(**proposal.model_dump(), name=name)  # type: ignore[attr-defined]
    measured = dict.fromkeys(MEASURES, 0.25)
    return CandidateOutcome(
        candidate=candidate,
        strength=strength,
        measured=measured,
        lap_s=111.0,
        lap_off_course=0.0,
        checkpoint="x",
    )


def test_the_sampler_breeds_from_the_best() -> None:
    sampler = Sampler(3)
    drawn = sampler.propose(brief(number=1))
    assert drawn == Sampler(3).propose(brief(number=1)) != Sampler(4).propose(brief(number=1))
    assert len({one.formula for one in drawn}) == len(drawn) == 20
    best, second = (outcome(drawn[index], f"1.{index}") for index in (0, 1))
    bred = sampler.propose(brief(outcomes=(best, second)))
    ages = [one.why for one in bred]
    assert ages.count("drawn") == 4
    assert ages.count("bred from 1.0") > ages.count("bred from 1.1") > 0
    of_the_best = {gene.term for gene in best.candidate.genes[1:]}
    for one in bred:
        if one.why == "bred from 1.0":
            kept = of_the_best & {gene.term for gene in one.genes}
            assert len(kept) >= len(of_the_best) - 1


@pytest.mark.parametrize(
    ("reply", "formulas"),
    [
        ('[{"formula": "progress / m", "why": "pace"}]', ["progress / m"]),
        (
            'Here [as asked]:\n```json\n[{"formula": "kerb\\n - out"}, "out", 7, {"x": 1}]\n```',
            ["kerb - out", "out"],
        ),
        ("I cannot.", []),
        ("[" * 5000, []),
        ('{"formula": "progress / m"}', []),
        ('[{"formula": "pro\\u202egress"}]', ["pro\\u202egress"]),
    ],
)
def test_formulas_are_found_in_a_reply(reply: str, formulas: list[str]) -> None:
    assert [one.formula for one in read_reply(reply)] == formulas


@pytest.mark.parametrize(
    ("reply", "verdict"),
    [
        ('{"better": "A", "why": "calm"}', (1, "calm")),
        ('```json\n{"better": "B"}\n```', (-1, "")),
        ('{"better": "same", "why": 5}', (0, "")),
        ('{"better": "C"}', None),
        ("A", None),
        ('{"better"', None),
    ],
)
def test_verdicts_are_found_in_a_reply(reply: str, verdict: tuple[int, str] | None) -> None:
    assert read_verdict(reply) == verdict


def test_a_model_is_told_all_that_it_may_use_and_what_came_of_it() -> None:
    drawn = Sampler(3).propose(brief(number=1))
    said = messages(
        brief(
            outcomes=(outcome(drawn[0]),),
            remarks=("A cuts corners",),
            refused=(("kerb + s", "do not go together"),),
        )
    )
    system, user = (str(one["content"]) for one in said)
    assert all(f"\n{name}, " in system for name in QUANTITIES)
    for text in (TASK, drawn[0].formula, "A cuts corners", "kerb + s: do not go together", "lap 111.0 s"):
        assert text in user
    assert json.dumps(said)

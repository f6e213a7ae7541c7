"""What the coach says: facts in plain sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nathlon.results.coach import Advice, Cause, CoachedSection, CoachFacts, Mishap
from nathlon.results.words import percent

NAMED = 3
"""Sections that are named first."""
TOLD_S = 0.02
"""A section in which less is lost is not spoken of."""
TOLD_MISHAPS = 6
"""Of more only their number is told."""
MISHAPS = {
    "off_course": "leaves the course",
    "wall": "hits the wall",
    "penalty": "is given a penalty",
    "served": "serves one",
}
KINDS = {
    "champion": "the bundled champion",
    "driver": "the built-in driver",
    "recording": "the recorded race",
}


def tell(facts: CoachFacts) -> str:
    """All that is said, a paragraph for each subject."""
    paragraphs = [_lap(facts), *_losses(facts), *_advice(facts), *_steadiness(facts), *_craft(facts)]
    return "\n\n".join(paragraphs) + "\n"


def told_causes(section: CoachedSection) -> str:
    """Why time was lost in a section, in one phrase; empty where nothing is known."""
    return ", ".join(_cause(cause) for cause in section.causes)


def told_advice(advice: Advice, other: str) -> str:
    """What to do otherwise in a section, in one phrase."""
    amount = _number(advice.amount)
    place = f"{advice.at_m:.0f} m"
    match advice.kind:
        case "brake_later":
            return f"brake {amount} m later than at {place}"
        case "brake_earlier":
            return f"brake {amount} m earlier than at {place}, and carry more speed through"
        case "more_speed":
            return f"carry {amount} km/h more at {place}"
        case "throttle_earlier":
            return f"be at full throttle {amount} m earlier than at {place}"
        case "full_throttle":
            return f"stay at full throttle from {place} on, {amount} % more in the mean"
    whole = advice.share == 100.0
    how = (
        f"drive as {other} does"
        if whole
        else f"drive {advice.share:.0f} % of the way towards the lap of {other}"
    )
    return f"{how}, with the line {amount} m further {advice.side} at {place}"


def told_unproved(facts: CoachFacts) -> Iterator[str]:
    """Where nothing can be proved and why, a sentence for each reason."""
    where: dict[str, list[str]] = {}
    for one in facts.attempts:
        if one.unproved:
            where.setdefault(one.unproved, []).append(one.section)
    for why, sections in where.items():
        yield f"Nothing can be proved in {_listed(sections)}: {why}."


def told_mishaps(mishaps: Sequence[Mishap]) -> list[str]:
    """Walls, excursions and penalties, each in a phrase; of many only how often there were."""
    if len(mishaps) <= TOLD_MISHAPS:
        return [f"at {one.at_s:.1f} s: {one.text}" for one in mishaps]
    told = []
    for kind, phrase in MISHAPS.items():
        some = [one for one in mishaps if one.kind == kind]
        if some:
            times = f"{len(some)} times" if len(some) > 1 else "once"
            lost = f", {sum(one.penalty_s for one in some):.0f} s in all" if kind == "penalty" else ""
            told.append(f"{phrase} {times}, first at {some[0].at_s:.1f} s{lost}")
    return told


def told_gain(advice: Advice, sections: Sequence[CoachedSection]) -> str:
    """What an advice gained when it was driven again."""
    after = sections[min(advice.number + 1, len(sections) - 1)].name
    return (
        f"driven again from {advice.starts} starts it gains at least {advice.gain_s:.3f} s by the end of "
        f"{after} ({advice.again_s:.3f} s without, {advice.edited_s:.3f} s with it)"
    )


def _lap(facts: CoachFacts) -> str:
    who = f"{facts.other}, {KINDS[facts.other_kind]}"
    apart = f"{abs(facts.lost_s):.3f} s {'more' if facts.lost_s > 0.0 else 'less'} than"
    if round(facts.lost_s, 3) == 0.0:
        apart = "as long as"
    line = f"The best lap of {facts.name} on {facts.raced.circuit} takes {facts.lap.lap_s:.3f} s. "
    line += f"That is {apart} the lap of {who}: {facts.other_lap_s:.3f} s."
    if facts.pace is not None:
        share = percent(facts.pace.speed_share)
        line += f" It is slower everywhere: at {share} of that one's speed in the median."
    if facts.limit_s is not None:
        line += f" The limit of circuit and car is {facts.limit_s:.3f} s."
    return line


def _losses(facts: CoachFacts) -> Iterator[str]:
    lost = sorted((one for one in facts.sections if one.lost_s >= TOLD_S), key=lambda one: -one.lost_s)
    if not lost:
        return
    named = _listed([f"{one.name} ({one.lost_s:.3f} s)" for one in lost[:NAMED]])
    yield f"Most is lost in {named}."
    lines = []
    for one in lost:
        why = told_causes(one)
        lines.append(f"- {one.name}, {one.lost_s:.3f} s lost{': ' + why if why else ''}.")
    yield "\n".join(lines)


def _advice(facts: CoachFacts) -> Iterator[str]:
    tried = sum(one.tried for one in facts.attempts)
    if not facts.advice:
        yield " ".join(
            [
                f"{tried} other ways to drive were tried, and none gained: there is no advice.",
                *told_unproved(facts),
            ]
        )
        return
    lines = [f"What is faster, of {tried} other ways to drive that were tried:"]
    for number, one in enumerate(facts.advice, 1):
        what = told_advice(one, facts.other)
        lines.append(f"{number}. {one.section}: {what}; {told_gain(one, facts.sections)}.")
        also = [each for each in facts.alternatives if each.number == one.number]
        if also:
            told = [f"{told_advice(each, facts.other)} ({each.gain_s:.3f} s)" for each in also]
            lines.append(f"   Instead of it: {'; or '.join(told)}.")
    yield "\n".join(lines)
    if facts.together_s is not None:
        yield f"All of it at once, driven from line to line, gains {facts.together_s:.3f} s."
    if unproved := " ".join(told_unproved(facts)):
        yield unproved


def _steadiness(facts: CoachFacts) -> Iterator[str]:
    steady = facts.consistency
    if steady is not None:
        yield (
            f"Of {steady.laps} flying laps the best takes {steady.best_s:.3f} s, the mean "
            f"{steady.mean_s:.3f} s, with a standard deviation of {steady.deviation_s:.3f} s. The best of "
            f"each section together make {steady.sum_of_best_s:.3f} s. Times differ most in "
            f"{steady.least_steady}, by {steady.least_steady_s:.3f} s."
        )


def _craft(facts: CoachFacts) -> Iterator[str]:
    craft = facts.craft
    made, lost = ([one for one in craft.passes if one.by_car == by] for by in (True, False))
    lines = []
    for title, some in (("Passes", made), ("Passed by", lost)):
        if some:
            told = [
                f"{one.car} at {one.at_s:.1f} s{' in ' + one.section if one.section else ''}"
                f"{'' if one.stands else ', not for good'}"
                for one in some
            ]
            lines.append(f"{title}: {'; '.join(told)}.")
    if craft.defences:
        told = [
            f"{one.car} from {one.from_s:.1f} s to {one.until_s:.1f} s, as near as {one.closest_m:.1f} m, "
            f"{'held' if one.held else 'lost'}"
            for one in craft.defences
        ]
        lines.append(f"Pressed by: {'; '.join(told)}.")
    faults = {"own": "its own fault", "other": "the fault of the other", "nobody": "nobody's fault"}
    lines += [f"Contact at {one.at_s:.1f} s, {faults[one.fault]}: {one.text}." for one in craft.contacts]
    lines += [f"{one[:1].upper()}{one[1:]}." for one in told_mishaps(craft.mishaps)]
    if lines:
        yield "\n".join(lines)


def _cause(cause: Cause) -> str:
    own, other = cause.own or 0.0, cause.other or 0.0
    apart = _number(abs(own - other))
    match cause.kind:
        case "braking_early":
            return f"braking {apart} m earlier"
        case "braking_late":
            return f"braking {apart} m later"
        case "entry_speed":
            return f"{apart} km/h too fast on the way in, at {cause.at_m:.0f} m"
        case "minimum_speed":
            return f"{apart} km/h slower at the slowest place"
        case "speed":
            return f"{apart} km/h slower at {cause.at_m:.0f} m"
        case "line":
            return f"a line {apart} m further {'left' if own > other else 'right'} at {cause.at_m:.0f} m"
        case "throttle":
            return f"full throttle {apart} m later"
        case "traction":
            return f"less drive on the way out, {own:.1f} m/s² against {other:.1f} m/s²"
        case "exit_speed":
            return f"{apart} km/h slower out of the bend before"
        case "lifting":
            return f"{own:.0f} % throttle in the mean against {other:.0f} %"
        case "traffic":
            where = f"{own:.0f} m ahead" if own >= 1.0 else "beside it"
            return f"{cause.car} {where}"
        case "contact":
            return f"a contact with {cause.car}"
    return {
        "standing_start": "a standing start",
        "off_course": f"off course at {cause.at_m:.0f} m",
        "wall": f"the wall at {cause.at_m:.0f} m",
        "penalty": "a penalty served",
    }[cause.kind]


def _number(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"

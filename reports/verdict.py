"""Whom to send and why, in words that claim no more than the committee said and the races prove."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from nathlon.arena.voids import is_void
from nathlon.results.selection import Selection
from nathlon.results.summary import CandidateStanding, Decided, Summary
from nathlon.results.words import AUTOMATIC, STAGES, counted, interval, percent

Row = Mapping[str, Any]

REASONS_SHOWN = 2
"""Of the ballots in the first sentence; people come before rules."""


@dataclass(frozen=True)
class Verdict:
    """A headline and at most three sentences: the decision, what the races prove of it, how it drove.

    A last one follows where runs are void.
    """

    headline: str
    sentences: tuple[str, ...]


def verdict(selection: Selection) -> Verdict:
    """What the committee decided, and how far the last stage that anybody reached bears it out."""
    told = _judged(selection)
    lost = selection.summary.void_runs
    return Verdict(told.headline, (*told.sentences, lost)) if lost else told


def _judged(selection: Selection) -> Verdict:
    decision = _decision(selection)
    if decision is None:
        return _unfinished(selection)
    ranking = selection.named("ranking").drop_nulls("points_per_race").to_dicts()
    if decision.open:
        missing = counted(decision.waits_for, "ballot")
        waits = f"waits for {missing}" if decision.waits_for else "has been asked again"
        return Verdict(
            "The committee has not decided",
            (
                f"It {waits}; {_reasons(decision)}.",
                _state_of(ranking, selection.summary),
                *_bars(selection, ranking),
            ),
        )
    sent = [standing for standing in decision.standings if standing.chosen]
    if not sent:
        return _nobody(selection, decision, ranking)
    name, entrant = sent[0].name, sent[0].entrant
    own = next((row for row in ranking if row["entrant"] == entrant), None)
    if own is None:
        proof: tuple[str, ...] = (_alone(selection, entrant),)
    else:
        candidates = {standing.entrant for standing in decision.standings}
        confidence = f"{percent(selection.summary.confidence)} interval"
        proof = (_proof(own, ranking, candidates, confidence, selection.summary), *_conduct(selection, own))
    better = _better_anchors(selection, {standing.entrant for standing in decision.standings})
    clauses = [f"{_listed(better, 'and')} {'is' if len(better) == 1 else 'are'} better"] if better else []
    if missed := _not_judged(selection.summary):
        clauses.append(f"{_listed(missed, 'and')} could not be judged")
    though = f", though {' and '.join(clauses)}" if clauses else ""
    return Verdict(f"Send {name}{though}", (_approval(decision, sent[0]), *proof))


def _approval(decision: Decided, sent: CandidateStanding) -> str:
    """Who has decided that an entrant is sent, and why."""
    members = [said["member"] for said in decision.said if said["event"] == "voted"]
    if members and all(member.startswith(AUTOMATIC) for member in members):
        return f"No member of the committee has voted, so {sent.name} is sent by {_reasons(decision)}."
    approved = f"approved on {sent.approved_by} of {counted(decision.ballots, 'ballot')}"
    return f"The committee sends {sent.name}, {approved}: {_reasons(decision)}."


def _alone(selection: Selection, entrant: str) -> str:
    """Of the only finalist: what the choice rests on."""
    own = selection.results.filter(pl.col("entrant") == entrant, ~is_void())
    runs = own.unique(["match", "race"])["stage"].to_list()
    summary = selection.summary
    stages = [
        f"{counted(runs.count(stage), summary.episode, summary.episodes)} of the {called}"
        for stage, called in STAGES.items()
        if stage in runs
    ]
    if not stages:
        return f"It was the only finalist, so no {summary.episode} supports the choice."
    return f"It was the only finalist: the choice rests on its {_listed(stages, 'and')}."


def _better_anchors(selection: Selection, candidates: set[str]) -> list[str]:
    """Anchors than which these races prove all candidates to be worse."""
    worse: dict[str, set[str]] = {}
    for row in selection.named("matchups").iter_rows(named=True):
        if row["entrant"] in candidates and row["difference_high"] is not None and row["difference_high"] < 0:
            worse.setdefault(row["opponent"], set()).add(row["entrant"])
    names = {row["entrant"]: row["name"] for row in selection.named("ranking").iter_rows(named=True)}
    return [
        names[one]
        for one, than in worse.items()
        if one in names and one not in candidates and than == candidates
    ]


def _not_judged(summary: Summary) -> list[str]:
    """Names of those that could not be judged, each once."""
    return list(dict.fromkeys(one.name for one in summary.not_judged))


def _decision(selection: Selection) -> Decided | None:
    decisions = selection.summary.committee
    return next((decision for decision in decisions if decision.question == "selection"), None)


def _reasons(decision: Decided) -> str:
    ballots = [said for said in decision.said if said["event"] == "voted"]
    if not ballots:
        return "nobody has voted"
    ballots.sort(key=lambda ballot: ballot["member"].startswith(AUTOMATIC))
    shown = "; ".join(f"{ballot['member']}, “{ballot['reason']}”" for ballot in ballots[:REASONS_SHOWN])
    more = len(ballots) - REASONS_SHOWN
    return f"{shown}; and {more} more" if more > 0 else shown


def _conduct(selection: Selection, own: Row) -> tuple[str, ...]:
    """How the entrant sent has behaved; nothing in a world that counts no contacts."""
    bars = _bars(selection, [own])
    if not bars:
        return (_faults(own).strip(),) if own["faults"] else ()
    return (f"{_manners(own)} {_barred(selection.named('ranking').to_dicts())}",)


def _bars(selection: Selection, rows: Sequence[Row]) -> tuple[str, ...]:
    """Who is barred for contacts; nothing in a world that counts none."""
    counts = selection.summary.circuit or any(row["contacts_per_km"] is not None for row in rows)
    return (_barred(rows),) if counts else ()


def _proof(own: Row, ranking: Sequence[Row], candidates: set[str], confidence: str, summary: Summary) -> str:
    """Of the entrant sent: its points, and whom these races prove to be better."""
    scored = f"It scored {_points(own, confidence, summary)}"
    if len(ranking) == 1:
        return f"{scored}. It {'raced' if summary.circuit else 'met'} nobody, so nothing is proven."
    first = [row for row in ranking if row["rank"] == 1]
    if own["rank"] > 1:
        better = own["rank"] - 1
        who = "1 other is" if better == 1 else f"{better} others are"
        leaders = _listed([f"{row['name']}{_why_not(row, candidates)}" for row in first], "and")
        return f"{scored}: {who} proven better. First: {leaders}."
    others = [row["name"] for row in first if row["entrant"] != own["entrant"]]
    if not others:
        return f"{scored}: alone in rank 1 of {len(ranking)}."
    tied = f"{len(others)} others" if len(others) > 3 else _listed(others, "and")
    return f"{scored}: statistically tied with {tied}."


def _why_not(row: Row, candidates: set[str]) -> str:
    if row["entrant"] not in candidates:
        return " (an anchor, cannot be sent)"
    return " (barred)" if row["barred"] else ""


def _points(row: Row, confidence: str, summary: Summary) -> str:
    within = _within(row["points_low"], row["points_high"], ".1f", confidence)
    if not row["races"]:
        return f"{row['points_per_race']:,.1f} points{within} in the n-athlon"
    raced = counted(row["races"], summary.episode, summary.episodes)
    number = f"{raced} of the {STAGES['tournament']}"
    if row["mean"] is not None:
        within = _within(row["mean_low"], row["mean_high"], ".2f", confidence)
        what = "points " if summary.brings == "points" else ""
        shares = f"won {percent(row['won'])}, drew {percent(row['drawn'])}, lost {percent(row['lost'])}"
        return f"{row['mean']:.2f} {what}{summary.an_episode} on average{within} in {number} ({shares})"
    return f"{row['points_per_race']:.1f} points {summary.an_episode}{within} in {number}"


def _faults(row: Row) -> str:
    return f" It ended {counted(row['faults'], 'car run')} by its own fault." if row["faults"] else ""


def _manners(row: Row) -> str:
    faults = _faults(row)
    if row["contacts_per_km"] is None:
        return f"Its contact rate is unknown.{faults}"
    blame = row["at_fault_per_km"]
    blamed = "" if blame is None else f", {blame:.2f} per km at fault"
    within = _within(row["contacts_low"], row["contacts_high"], ".2f")
    touched = f"{row['contacts_per_km']:.2f} contacts per km{within}"
    return f"There its cars had {touched}{blamed}.{faults}"


def _barred(ranking: Sequence[Row]) -> str:
    barred = [row["name"] for row in ranking if row["barred"]]
    if not barred:
        return "Nobody is barred for contacts."
    return f"Barred for contacts: {_listed(barred, 'and')}."


def _within(low: float | None, high: float | None, form: str, called: str = "") -> str:
    """An interval in brackets, after what it is called; nothing where it is not known."""
    within = interval(low, high, form)
    return within and f" ({called}{called and ' '}{within})"


def _nobody(selection: Selection, decision: Decided, ranking: Sequence[Row]) -> Verdict:
    if decision.standings:
        said = f"The committee found none of {counted(len(decision.standings), 'finalist')} fit"
        return Verdict(
            "Send nobody",
            (
                f"{said}: {_reasons(decision)}.",
                _state_of(ranking, selection.summary),
                *_bars(selection, ranking),
            ),
        )
    missed = _not_judged(selection.summary)
    why = f": {_listed(missed, 'and')} could not be judged" if missed else ""
    return Verdict(f"Send nobody{why}", _stages_so_far(selection))


def _state_of(ranking: Sequence[Row], summary: Summary) -> str:
    if not ranking:
        return "No team race was scored." if summary.circuit else f"No {summary.episode} was scored."
    first = [row["name"] for row in ranking if row["rank"] == 1]
    if len(first) == 1:
        return f"In the round robin {first[0]} is alone in rank 1."
    return f"In the round robin {_listed(first, 'and')} are statistically tied for first."


def _unfinished(selection: Selection) -> Verdict:
    return _drive(selection) or Verdict("Nobody to send yet", _stages_so_far(selection))


def _drive(selection: Selection) -> Verdict | None:
    """How a person came in, if it is the store's run of a test drive."""
    named = selection.tables["entrants"]
    people = dict(named.filter(pl.col("algorithm") == "person").select("entrant", "name").iter_rows())
    own = selection.results.filter(pl.col("entrant").is_in(list(people))).to_dicts()
    if not own:
        return None
    name, cars = people[own[0]["entrant"]], selection.results.height
    finished = own[0]["ending"] == "finished"
    came = f"came in place {own[0]['place']} of {cars}" if finished else "did not finish"
    ending = "" if finished else f": {own[0]['ending'].replace('_', ' ')}"
    return Verdict(
        "A test drive", (f"{name} {came}{ending}.", "Nobody is sent by it: people are in no ranking.")
    )


def _stages_so_far(selection: Selection) -> tuple[str, ...]:
    pareto, battery = selection.tables["pareto"], selection.named("battery")
    if pareto.is_empty():
        return ("No stage has been scored.",)
    survivors = int(pareto["survives"].sum())
    went = f"{survivors:,} of {counted(pareto.height, 'entrant')} survived the Pareto filter."
    if battery.is_empty():
        return (went, "No later stage was scored.")
    first = battery.filter(pl.col("rank") == 1).sort(["points", "name"], descending=[True, False])
    leader = first.row(0, named=True)
    tied = "" if first.height == 1 else f", statistically tied with {counted(first.height - 1, 'other')}"
    confidence = f"{percent(selection.summary.confidence)} interval"
    return (
        went,
        f"In the n-athlon {leader['name']} is first with {leader['points']:,.0f} points"
        f"{_within(leader['points_low'], leader['points_high'], '.0f', confidence)}{tied}.",
        _state_of(selection.named("ranking").drop_nulls("points_per_race").to_dicts(), selection.summary),
    )


def _listed(names: Sequence[str], conjunction: str) -> str:
    if len(names) == 1:
        return names[0]
    shown = list(names) if len(names) < 4 else [*names[:2], f"{len(names) - 2} more"]
    return f"{', '.join(shown[:-1])} {conjunction} {shown[-1]}"

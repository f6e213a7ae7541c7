"""The committee: evidence, automatic members, votes, decisions and their record."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from pydantic import ValidationError

from nathlon.arena.results import RANKING
from nathlon.arena.store import Store
from nathlon.selection.committee import ask as put
from nathlon.selection.committee import close, compare, reopen, vote
from nathlon.selection.committee.ballots import Ballot
from nathlon.selection.committee.event_log import LOG, EventLog
from nathlon.selection.committee.events import Closed, Opened, Voted
from nathlon.selection.committee.rules import CommitteeSettings, Gates, Rule, conduct, gather
from nathlon.selection.committee.sentences import names_in, sentence
from nathlon.sim.errors import InputError
from tests.support.committees import (
    ALONE,
    NAMES,
    PEOPLE,
    RUN,
    ask,
    battery,
    cast,
    chosen,
    entrant_id,
    entrants,
    ids,
    results,
)
from tests.support.race_results import rows


def ranking(points: dict[str, float | None], barred: Sequence[str] = ()) -> pl.DataFrame:
    facts: dict[str, list[Any]] = {
        "entrant": [entrant_id(name) for name in points],
        "points_per_race": list(points.values()),
        "barred": [name in barred for name in points],
    }
    return pl.DataFrame([pl.Series(n, facts.get(n, [None] * len(points)), t) for n, t in RANKING.items()])


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store(tmp_path / "store.sqlite") as made:
        made.begin_run(RUN, {})
        yield made


@pytest.fixture
def event_log(store: Store) -> EventLog:
    return EventLog(store, RUN)


def test_conduct_is_counted_over_all_races_that_are_not_void() -> None:
    frame = rows(
        {
            "entrant": ["a", "a", "b", "b", "c"],
            "race": [0, 1, 0, 1, 2],
            "distance_m": [2000.0, 500.0, 1000.0, 0.0, 0.0],
            "driven_s": [90.0, 10.0, 50.0, 5.0, 0.0],
            "off_course_s": [4.0, 1.0, 0.0, 0.0, 0.0],
            "contacts": [3, 2, 9, 9, 1],
            "contacts_at_fault": [1, 0, 9, 9, 0],
            "ending": ["finished", "timed_out", "finished", "interrupted", "policy_raised"],
        },
        5,
    )
    a, b, c = conduct(frame).iter_rows()
    assert a == ("a", 2.0, 1.5, 0.5, round(4 / 90, 9), 0)  # race 1 is void for both
    assert b == ("b", 1.0, 9.0, 9.0, 0.0, 0)
    assert c == ("c", 0.0, None, None, None, 1)


def test_without_people_the_points_decide_at_once(event_log: EventLog) -> None:
    decision = ask(event_log, ALONE)
    assert chosen(decision) == "ba"
    assert list(decision.said) == ["rule:battery"]
    assert decision.result is not None
    assert decision.result.standings[0].favour > 0.5
    assert decision.result.agreement is None


def test_gates_leave_out_the_ill_behaved_and_say_why(event_log: EventLog) -> None:
    gates = Gates(contacts_per_km=1.0, at_fault_per_km=0.2, off_course_share=0.1)
    settings = CommitteeSettings(
        shortlist=3, rule=(Rule(name="clean", by="battery", gates=gates), Rule(name="r", by="ranking"))
    )
    decision = ask(
        event_log,
        settings,
        contacts=[10, 11, 0, 0],
        contacts_at_fault=[2, 2, 3, 0],
        off_course_s=[30, 0, 0, 31],
    )
    assert chosen(decision) == "a"
    ballot = decision.ballots()["rule:clean"]
    assert ballot.reason == (
        "1 of 4 pass the gates, in order of n-athlon points; "
        "left out: birch (contacts per km: 1.1, at most 1); cedar (at fault per km: 0.3, at most 0.2); "
        "delta (off course: 10.3 %, at most 10 %)"
    )


def test_a_policy_that_fails_by_its_own_fault_is_not_shortlisted(event_log: EventLog) -> None:
    endings = ["finished", "policy_raised", "finished", "time_up"]
    assert chosen(ask(event_log, ALONE, ending=endings)) == "ac"


def test_the_selection_is_the_first_of_the_ranking_that_is_not_barred(event_log: EventLog) -> None:
    table = ranking({"amber": 21.0, "birch": 22.0, "cedar": 20.0}, barred=["birch"])
    decision = put(
        event_log, "selection", entrants(NAMES[:3]), {"ranking": table}, results(), CommitteeSettings()
    )
    assert chosen(decision) == "a"
    assert "birch (barred from the ranking)" in decision.ballots()["rule:ranking"].reason


@pytest.mark.parametrize(("left", "expected"), [((), ""), (("cedar",), "c")])
def test_few_finalists_are_no_trouble(event_log: EventLog, left: tuple[str, ...], expected: str) -> None:
    decision = put(
        event_log, "selection", entrants(left), {"ranking": ranking({})}, results(), CommitteeSettings()
    )
    assert chosen(decision) == expected


def test_a_question_is_put_once(event_log: EventLog) -> None:
    first = ask(event_log, ALONE)
    entries = event_log.entries()
    assert ask(event_log, ALONE) == first
    assert event_log.entries() == entries


def test_a_run_that_was_cut_off_anywhere_decides_the_same(event_log: EventLog, tmp_path: Path) -> None:
    settings = CommitteeSettings(
        shortlist=3, rule=(Rule(name="x", by="battery"), Rule(name="y", by="battery"), *ALONE.rule)
    )
    expected = chosen(ask(event_log, settings))
    entries = event_log.entries()
    assert len(entries) == 5
    for cut in range(5):
        with Store(tmp_path / f"cut-{cut}.sqlite") as store:
            store.begin_run(RUN, {})
            other = EventLog(store, RUN)
            for entry in entries[:cut]:
                other.add(entry.event)
            assert chosen(ask(other, settings)) == expected
            assert [entry.event for entry in other.entries()] == [entry.event for entry in entries]


def test_people_are_waited_for(event_log: EventLog) -> None:
    assert ask(event_log, PEOPLE).result is None
    cast(event_log, "ann", "cd", "cd")
    decision = ask(event_log, PEOPLE)
    assert (decision.result, decision.waits_for) == (None, 1)
    with pytest.raises(InputError, match=r"^shortlist-\w+ waits for 1 more of its members, expected 2 to"):
        close(event_log, decision, "ann")
    compare(event_log, decision, "bob", ids("d")[0], ids("c")[0], "delta is calmer")
    # The rule says b a c d and Ann c d before a and b, and half of the ballots or more approve each. Nothing
    # beats b and c; b has one answer to none against a, c only two to one against d.
    assert chosen(ask(event_log, PEOPLE)) == "bc"


def test_most_ballots_must_approve(event_log: EventLog) -> None:
    ask(event_log, PEOPLE)
    cast(event_log, "ann", "acd", "acd")
    cast(event_log, "bob", "ad", "ad")
    cast(event_log, "cy", "d", "d")
    decision = close(event_log, event_log.decisions()["shortlist"], "cy")
    assert decision.result is not None
    standings = {standing.entrant[0]: standing for standing in decision.result.standings}
    assert {letter: standing.approved_by for letter, standing in standings.items()} == {
        "a": 3,
        "b": 1,
        "c": 2,
        "d": 4,
    }
    assert {letter for letter, standing in standings.items() if standing.fit} == {"a", "c", "d"}
    assert list(standings)[-1] == "b"
    # a is before d on three ballots of four.
    assert chosen(decision) == "ad"
    assert decision.result.ballots == 4


def test_a_new_ballot_replaces_all_and_a_comparison_one_answer(event_log: EventLog) -> None:
    ask(event_log, PEOPLE)
    cast(event_log, "ann", "abcd", "abcd")
    compare(event_log, event_log.decisions()["shortlist"], "ann", ids("d")[0], ids("a")[0], "seen on video")
    stated = event_log.decisions()["shortlist"].preferences()["ann"]
    a, b, c, d = (list(event_log.decisions()["shortlist"].opened.candidates).index(i) for i in ids("abcd"))
    assert stated[a, [a, b, c, d]].tolist() == [0, 1, 1, -1]
    assert stated[d, [a, b, c, d]].tolist() == [1, -1, -1, 0]
    cast(event_log, "ann", "d")
    stated = event_log.decisions()["shortlist"].preferences()["ann"]
    assert stated[d, [a, b, c, d]].tolist() == [1, 1, 1, 0]
    assert not stated[a, [b, c]].any()


def test_a_closed_decision_is_reopened_never_rewritten(event_log: EventLog) -> None:
    settings = CommitteeSettings(members=("ann", "bob"), shortlist=2)
    decision = ask(event_log, settings)
    before = event_log.entries()
    with pytest.raises(InputError, match=r"^shortlist-\w+ is closed; reopen it first$"):
        cast(event_log, "ann", "cd", "cd")
    reopen(event_log, decision, "bob", "nobody had watched the videos")
    cast(event_log, "ann", "cd", "cd")
    cast(event_log, "bob", "cd", "cd")
    again = ask(event_log, settings)
    assert again.result is None  # it is for those who reopened it to decide
    assert chosen(close(event_log, again, "bob")) == "cd"
    assert chosen(ask(event_log, settings)) == "cd"
    assert event_log.entries()[: len(before)] == before
    closings = [e.event.result.chosen for e in event_log.entries() if isinstance(e.event, Closed)]
    assert closings == [ids("ba"), ids("cd")]
    with pytest.raises(InputError, match=r"is open, expected a decision that is closed"):
        reopen(event_log, again, "bob", "once more")  # this caller still holds the open decision


def test_a_vote_that_came_too_late_is_kept_and_counts_after_reopening(event_log: EventLog) -> None:
    settings = CommitteeSettings(members=("ann",), shortlist=2)
    decision = ask(event_log, settings)
    event_log.add(
        Voted(
            decision=decision.name,
            member="ann",
            approve=ids("cd"),
            rank=ids("dc"),
            reason="I was on the way",
            evidence=decision.opened.evidence.digest,
        )
    )
    decision = event_log.decisions()["shortlist"]
    assert chosen(decision) == "ba"
    assert [entry.event for entry in decision.late] == [event_log.entries()[-1].event]
    reopen(event_log, decision, "ann", "Ann's vote was late")
    decision = event_log.decisions()["shortlist"]
    assert decision.late == []
    assert set(decision.ballots()) == {"rule:battery", "ann"}


def test_only_members_decide_and_ask_again(event_log: EventLog) -> None:
    settings = CommitteeSettings(members=("ann",), shortlist=2)
    decision = ask(event_log, settings)
    with pytest.raises(InputError, match=r"^'eve' is not on the committee, expected one of ann$"):
        reopen(event_log, decision, "eve", "I do not like it")
    reopen(event_log, decision, "ann", "one more look")
    before = event_log.entries()
    with pytest.raises(InputError, match=r"^'eve' is not on the committee"):
        close(event_log, event_log.decisions()["shortlist"], "eve")
    assert event_log.entries() == before
    close(event_log, event_log.decisions()["shortlist"], "ann")
    names = names_in(event_log.entries())
    authors = ["the run", "rule:battery", "the run", "ann", "ann"]
    assert [entry.event.member for entry in event_log.entries()] == authors
    told = [sentence(entry, names) for entry in event_log.entries()]
    assert all(author in line for author, line in zip(authors, told, strict=True))
    assert told[-2:] == ["reopened by ann: one more look", "closed by ann: birch, amber"]


def test_logs_from_before_authors_were_noted_are_read(store: Store, event_log: EventLog) -> None:
    settings = CommitteeSettings(members=("ann",), shortlist=2)
    reopen(event_log, ask(event_log, settings), "ann", "again")
    store.begin_run("before", {})
    for entry in event_log.entries():
        event = entry.event.model_dump(mode="json")
        if event["event"] != "voted":
            del event["member"]
        store.append(LOG, event, "before")
    old = EventLog(store, "before")
    names = names_in(old.entries())
    assert [sentence(entry, names) for entry in old.entries()[-2:]] == [
        "closed: birch, amber",
        "reopened: again",
    ]
    # It is the same question, so it is not put again.
    assert ask(old, settings).name == event_log.decisions()["shortlist"].name
    assert len(old.entries()) == len(event_log.entries())


def test_of_two_who_close_at_once_the_first_counts(event_log: EventLog) -> None:
    settings = CommitteeSettings(members=("ann",), shortlist=2)
    reopen(event_log, ask(event_log, settings), "ann", "again")
    decision = event_log.decisions()["shortlist"]
    cast(event_log, "ann", "cd", "cd")
    close(event_log, decision, "ann")  # has not seen Ann's ballot
    event_log.add(
        Closed(decision=decision.name, member="ann", result=event_log.decisions()["shortlist"].tally())
    )
    decision = event_log.decisions()["shortlist"]
    assert chosen(decision) == "ba"
    assert len(decision.late) == 1


def test_votes_cast_at_the_same_time_are_all_kept(event_log: EventLog, tmp_path: Path) -> None:
    ask(event_log, PEOPLE)

    def insist(member: str) -> None:
        with Store.open(tmp_path / "store.sqlite") as own:
            for _ in range(8):
                cast(EventLog(own, RUN), member, "ab", "ab")

    with ThreadPoolExecutor(3) as pool:
        list(pool.map(insist, PEOPLE.members))
    votes = [e.event.member for e in event_log.entries() if isinstance(e.event, Voted)]
    assert {member: votes.count(member) for member in PEOPLE.members} == dict.fromkeys(PEOPLE.members, 8)
    assert len({entry.id for entry in event_log.entries()}) == len(event_log.entries())


def test_other_evidence_is_another_decision(event_log: EventLog) -> None:
    first = ask(event_log, PEOPLE)
    cast(event_log, "ann", "cd", "cd")
    second = ask(event_log, PEOPLE, contacts=[1, 0, 0, 0])
    assert second.name != first.name
    assert "ann" not in second.said
    assert [e.event.question for e in event_log.entries() if isinstance(e.event, Opened)] == ["shortlist"] * 2


def test_runs_have_committees_of_their_own(store: Store, event_log: EventLog) -> None:
    store.begin_run("next", {})
    ask(event_log, ALONE)
    assert EventLog(store, "next").decisions() == {}


def test_the_digest_of_the_evidence_tells_any_change() -> None:
    def digest(table: pl.DataFrame, races: pl.DataFrame) -> str:
        return gather("shortlist", entrants(), {"battery": table}, races).digest

    same = digest(battery(), results())
    assert digest(battery(), results()) == same
    assert digest(battery().with_columns(points_low=pl.col("points_low") + 1e-9), results()) != same
    assert digest(battery(), results(contacts=[0, 0, 0, 1])) != same


@pytest.mark.parametrize(
    ("member", "approve", "rank", "reason", "message"),
    [
        ("eve", "a", "a", "why", r"^'eve' is not on the committee, expected one of ann, bob, cy$"),
        ("rule:battery", "a", "a", "why", r"^'rule:battery' is not on the committee"),
        ("ann", "a", "a", " ", r"^reason is empty, expected a sentence$"),
        ("ann", "aa", "a", "why", r"^approve names an entrant twice"),
        ("ann", "ab", "aba", "why", r"^rank names an entrant twice"),
        ("ann", "ab", "acb", "why", r"^rank puts cedar before an approved entrant, but it is not approved$"),
    ],
)
def test_a_wrong_ballot_is_one_sentence(
    event_log: EventLog, member: str, approve: str, rank: str, reason: str, message: str
) -> None:
    decision = ask(event_log, PEOPLE)
    with pytest.raises(InputError, match=message):
        vote(event_log, decision, member, Ballot(ids(approve), ids(rank)), reason)
    assert len(event_log.entries()) == 2


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"members": ["ann", "ann"]}, "members has 'ann' twice"),
        ({"members": ["rule:ann"]}, "expected a name that does not begin with 'rule:'"),
        ({"members": ["ann"], "quorum": 2}, "quorum is 2, expected at most the 1 members"),
        ({"rule": [{"name": "x", "by": "battery"}]}, "expected a rule by 'ranking', or a quorum"),
        ({"rule": [{"name": "x", "by": "laps"}]}, "'battery' or 'ranking'"),
        ({"rule": [{"name": "x", "by": "battery", "gates": {"off_course_share": 2}}]}, "less than or equal"),
    ],
)
def test_wrong_settings_are_told(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        CommitteeSettings.model_validate(fields)

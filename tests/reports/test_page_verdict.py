from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nathlon.reports.verdict import verdict
from nathlon.results.selection import Selection
from tests.support.selections import PERSON, RULE, build, card, decided, ranked, with_tables

CARDS = [card(i, f"e{i}") for i in range(6)]
IDS = [one["entrant"] for one in CARDS]


def night(
    *rows: dict[str, Any],
    cards: list[dict[str, Any]] | None = None,
    seats: int = 1,
    met: Sequence[dict[str, Any]] = (),
    **decision: Any,
) -> Selection:
    """Finalists with a ranking and matchups, and a committee that sends the first of `cards`."""
    asked = decided("selection", CARDS[: len(rows)] if cards is None else cards, seats, **decision)
    return with_tables({"entrants": CARDS, "ranking": list(rows), "matchups": list(met)}, committee=[asked])


def matchup(entrant: int, opponent: int, difference: float) -> dict[str, Any]:
    return {
        "entrant": IDS[entrant],
        "opponent": IDS[opponent],
        "pairs": 40,
        "points_per_race": 19.5 + difference / 2.0,
        "difference": difference,
        "difference_low": difference - 1.0,
        "difference_high": difference + 1.0,
        "contacts_per_km": 0.1,
    }


def test_first_alone() -> None:
    told = verdict(night(ranked(IDS[0], 1, 22.0), ranked(IDS[1], 2, 17.0), ballots=(PERSON, RULE)))
    assert told.headline == "Send e0"
    assert told.sentences[0] == (
        "The committee sends e0, approved on 2 of 2 ballots: ann, “calm in traffic <b>& fair</b>”; "
        "rule:ranking, “all pass the gates, in order of points in the round robin”."
    )
    assert told.sentences[1] == (
        "It scored 22.0 points a race (95 % interval 21.2 to 22.8) in 80 races of the round robin: "
        "alone in rank 1 of 2."
    )
    assert told.sentences[2] == (
        "There its cars had 0.20 contacts per km (0.15 to 0.26), 0.10 per km at fault. "
        "Nobody is barred for contacts."
    )


def test_a_rule_alone_is_no_committee() -> None:
    told = verdict(night(ranked(IDS[0], 1, 22.0), ranked(IDS[1], 2, 17.0), ballots=(RULE,)))
    assert told.sentences[0] == (
        "No member of the committee has voted, so e0 is sent by rule:ranking, "
        "“all pass the gates, in order of points in the round robin”."
    )


def test_a_shared_first_rank_is_a_tie() -> None:
    rows = [ranked(IDS[0], 1, 20.0), ranked(IDS[1], 1, 20.4), ranked(IDS[2], 3, 9.0)]
    told = verdict(night(*rows))
    assert told.sentences[1].endswith("in 80 races of the round robin: statistically tied with e1.")
    many = verdict(night(*(ranked(entrant, 1, 20.0) for entrant in IDS)))
    assert many.sentences[1].endswith("statistically tied with 5 others.")


def test_sent_though_others_are_proven_better() -> None:
    rows = [
        ranked(IDS[0], 3, 20.0, faults=2),
        ranked(IDS[1], 1, 30.0, barred=True),
        ranked(IDS[2], 1, 29.0),
    ]
    told = verdict(night(*rows, cards=CARDS[:2]))
    assert told.headline == "Send e0"
    assert told.sentences[1].endswith(
        "2 others are proven better. First: e1 (barred) and e2 (an anchor, cannot be sent)."
    )
    assert told.sentences[2].endswith("It ended 2 car runs by its own fault. Barred for contacts: e1.")


def test_all_candidates_are_worse_than_an_anchor() -> None:
    rows = [ranked(IDS[0], 2, 20.0), ranked(IDS[1], 2, 19.0), ranked(IDS[2], 1, 30.0)]
    met = [matchup(0, 2, -8.0), matchup(2, 0, 8.0), matchup(1, 2, -9.0), matchup(0, 1, 0.5)]
    assert verdict(night(*rows, cards=CARDS[:2], met=met)).headline == "Send e0, though e2 is better"
    # One of them is not proven to be worse.
    met[2] = matchup(1, 2, -0.5)
    assert verdict(night(*rows, cards=CARDS[:2], met=met)).headline == "Send e0"
    # Who is a candidate too could have been sent.
    assert verdict(night(*rows, met=met)).headline == "Send e0"


def test_nobody_fit() -> None:
    rows = [ranked(IDS[0], 1, 20.0), ranked(IDS[1], 1, 19.0)]
    told = verdict(night(*rows, seats=0))
    assert told.headline == "Send nobody"
    assert told.sentences[0].startswith(
        "The committee found none of 2 finalists fit: rule:ranking, “all pass"
    )
    assert told.sentences[1].startswith("In the round robin e0 and e1 are statistically tied")


def test_waiting_for_people() -> None:
    asked = night(ranked(IDS[0], 1, 20.0), ranked(IDS[1], 2, 15.0), open=True, waits_for=2)
    told = verdict(asked)
    assert told.headline == "The committee has not decided"
    assert told.sentences[0].startswith("It waits for 2 ballots; rule:ranking, “all pass")
    assert told.sentences[1].startswith("In the round robin e0 is alone in rank 1")
    again = verdict(night(ranked(IDS[0], 1, 20.0), open=True, waits_for=0))
    assert again.sentences[0].startswith("It has been asked again")


def test_single_finalist_and_unknown_contacts() -> None:
    lost: dict[str, Any] = dict.fromkeys(
        ("contacts_per_km", "contacts_low", "contacts_high", "at_fault_per_km")
    )
    alone = verdict(night(ranked(IDS[0], 1, 10.0, faults=320, **lost)))
    assert alone.sentences[1].endswith("of the round robin. It raced nobody, so nothing is proven.")
    assert alone.sentences[2].startswith(
        "Its contact rate is unknown. It ended 320 car runs by its own fault."
    )
    unraced = verdict(night(ranked(IDS[0], 1, None)))
    assert unraced.sentences[1] == "It was the only finalist, so no race supports the choice."


def test_before_the_committee_is_asked() -> None:
    filtered = build(np.random.default_rng(4), 30, 0)
    told = verdict(with_tables({}))
    assert (told.headline, told.sentences) == ("Nobody to send yet", ("No stage has been scored.",))
    tables = {name: table.to_dicts() for name, table in filtered.tables.items()}
    battery = verdict(with_tables(tables))
    survivors = int(filtered.tables["pareto"]["survives"].sum())
    assert battery.sentences[0] == f"{survivors} of 30 entrants survived the Pareto filter."
    assert battery.sentences[1].startswith("In the n-athlon coast-")
    assert battery.sentences[2] == "No team race was scored."
    nobody = verdict(with_tables(tables, committee=[decided("selection", [], 1)]))
    assert nobody.headline == "Send nobody"


def test_at_most_three_sentences() -> None:
    for seed in range(4):
        assert len(verdict(build(np.random.default_rng(seed))).sentences) <= 3

"""A synthetic selection with the shape of a real one, for the tests of reports."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl

from nathlon.arena.results import RESULTS, TABLES
from nathlon.results.selection import Previous, Selection
from nathlon.results.summary import Sent, Summary

TESTS = ("hot_lap", "race_eight", "grid_start", "slipstream_pass", "final_chicane", "mistake_recovery")
MARKS = {"base": 90.0, "reference": 85.0, "asks": "The best of four laps alone."}
PERSON = ("ann", "calm in traffic <b>& fair</b>")
RULE = ("rule:ranking", "all pass the gates, in order of points in the round robin")
BROKEN = f"/home/somebody/{'a-long-name' * 9}/broken.safetensors"
TEAM_MEAN = 19.5  # half of 10 + 8 + 6 + 5 + 4 + 3 + 2 + 1


def build(rng: np.random.Generator, entrants: int = 60, finalists: int = 8, laps: float = 0.93) -> Selection:
    """A selection of `entrants` checkpoints; a share of 1 - `laps` of them never completes a lap."""
    cards = [_card(i) for i in range(entrants)]
    skill = rng.normal(size=entrants)
    has_lap = rng.random(entrants) < laps
    pareto = [
        _pareto(card["entrant"], s, lap, rng) for card, s, lap in zip(cards, skill, has_lap, strict=True)
    ]
    survivors = sorted(_front(pareto), key=lambda i: -skill[i])
    for i in survivors:
        pareto[i] |= {"survives": True, "nondominated_probability": float(rng.uniform(0.05, 1.0))}
    ids = [cards[i]["entrant"] for i in survivors]
    skills = [
        _skill(entrant, test, skill[i], rng)
        for i, entrant in zip(survivors, ids, strict=True)
        for test in TESTS
    ]
    battery = _battery(ids, skills, finalists)
    final = ids[:finalists]
    strength = {entrant: 5.0 - 1.4 * place for place, entrant in enumerate(final)}
    return with_tables(
        {
            "entrants": cards,
            "pareto": pareto,
            "objectives": [row for one in pareto for row in _objectives(one)],
            "skills": skills,
            "battery": battery,
            "ranking": _ranking(final, strength, rng),
            "matchups": _matchups(final, strength, rng),
            "ratings": [_rated(entrant, place) for place, entrant in enumerate(final)],
        },
        results=[
            _result(sides[car % 2], race, car, hashlib.sha256(b"match %d" % index).hexdigest())
            for index, sides in enumerate(itertools.combinations(final, 2))
            for race in range(2)
            for car in range(8)
        ],
        sent=[{"name": cards[survivors[0]]["name"], "entrant": final[0]}] if final else [],
        committee=[
            decided("shortlist", [cards[i] for i in survivors], finalists),
            decided("selection", [cards[i] for i in survivors[:finalists]], 1, [PERSON, RULE]),
        ],
    )


def with_tables(
    rows: dict[str, list[dict[str, Any]]], results: list[dict[str, Any]] | None = None, **summary: Any
) -> Selection:
    """A selection of the given rows; tables that are not named are empty."""
    tables = {name: pl.DataFrame(rows.get(name, []), schema=schema) for name, schema in TABLES.items()}
    names = dict(tables["entrants"].select("entrant", "name").iter_rows())
    count = {name: table.height for name, table in tables.items()}
    facts: dict[str, Any] = {
        "stages": [
            _stage("pareto", count["pareto"], count["battery"], 4 * count["pareto"], 412.0),
            _stage("battery", count["battery"], count["ranking"], 24 * count["battery"], 96.4),
            _stage("tournament", count["ranking"], min(1, count["ranking"]), 2240, 1318.2),
        ],
        "seed": 7,
        "circuit": "harbour",
        "car": "gt3",
        "versions": {"nathlon": "0.1.0", "numba": "0.63.1", "torch": "2.9.1"},
        "pair_correlation": 0.31,
        "confidence": 0.95,
        "car_runs": 18_000,
        "faults": 3,
        "void": 0,
        "ranking": [{"name": names[row["entrant"]], **row} for row in tables["ranking"].to_dicts()],
        "sent": [],
        "committee": [],
        "marks": dict.fromkeys(TESTS, MARKS) | {"grid_start": {**MARKS, "stretch_m": (-60.0, 480.0)}},
        "tests_set_aside": {"chicane_in_traffic": "harbour has no chicane"},
        "excluded": [{"source": BROKEN, "reason": f"{BROKEN}: not a checkpoint", "digest": None}],
        "replays": [],
    }
    return Selection(
        title="Harbour, GT3: nightly selection",
        tables=tables,
        results=pl.DataFrame(results or [], schema=RESULTS),
        summary=Summary.model_validate(facts | summary),
        store="nathlon.sqlite",
    )


def decided(
    question: str,
    cards: list[dict[str, Any]],
    seats: int,
    ballots: Sequence[tuple[str, str]] = (RULE,),
    **more: Any,
) -> dict[str, Any]:
    """A decision as `committee.decision.describe` tells it: the first of the cards are chosen."""
    ids = [card["entrant"] for card in cards]
    evidence = {"points": 20.0, "contacts_per_km": 0.2, "at_fault_per_km": 0.1, "off_course_share": 0.01}
    return {
        "decision": f"{question}-0123456789ab",
        "question": question,
        "seats": seats,
        "open": False,
        "waits_for": 0,
        "evidence": {
            "digest": "0" * 64,
            "rows": [{"entrant": entrant, "barred": False, "faults": 0} | evidence for entrant in ids],
            "tables": {},
        },
        "said": [
            {
                "id": index,
                "at": "2031-05-04T03:21:00.000000+00:00",
                "event": "voted",
                "decision": f"{question}-0123456789ab",
                "member": member,
                "approve": ids,
                "rank": ids,
                "reason": reason,
                "evidence": "0" * 64,
            }
            for index, (member, reason) in enumerate(ballots)
        ],
        "late": [],
        "ballots": len(ballots),
        "agreement": 1.0 if len(ballots) > 1 else None,
        "standings": [
            {
                "name": card["name"],
                "entrant": card["entrant"],
                "approved_by": len(ballots),
                "fit": True,
                "favour": 1.0 - index / max(1, len(cards)),
                "chosen": index < seats,
            }
            for index, card in enumerate(cards)
        ],
    } | more


def night_before(selection: Selection) -> Previous:
    """The night before: without the first of the ranking, and with the ranks turned round."""
    ranking = selection.tables["ranking"]
    newcomer, pool = ranking["entrant"][0], ranking[1:]
    return Previous(
        "night-0001",
        "2031-05-03T03:21:00.000000+00:00",
        selection.tables["entrants"].filter(pl.col("entrant") != newcomer),
        pool.with_columns(pl.col("rank", "worst_rank").reverse()),
        (Sent(name="coast-old", entrant=pool["entrant"][0]),),
    )


def card(index: int, name: str) -> dict[str, Any]:
    """The row of `entrants` for the checkpoint with this index and name."""
    return {
        "entrant": hashlib.sha256(str(index).encode()).hexdigest(),
        "name": name,
        "source": f"checkpoints/{index:04d}.safetensors",
        "algorithm": "qr-sac",
        "circuit": "harbour",
        "car": "gt3",
        "step": 2500 * (index + 1),
        "seed": index % 4,
    }


def ranked(
    entrant: str, rank: int, points: float | None, half_width: float = 0.8, **more: Any
) -> dict[str, Any]:
    """A row of `ranking` with a symmetric interval of points."""
    return {
        "entrant": entrant,
        "rank": rank,
        "worst_rank": rank,
        "points_per_race": points,
        "points_low": None if points is None else points - half_width,
        "points_high": None if points is None else points + half_width,
        "contacts_per_km": 0.2,
        "contacts_low": 0.15,
        "contacts_high": 0.26,
        "at_fault_per_km": 0.1,
        "at_fault_low": 0.07,
        "at_fault_high": 0.14,
        "barred": False,
        "pairs": 40,
        "races": 80,
        "faults": 0,
    } | more


def _stage(name: str, entered: int, left: int, races: int, wall_s: float) -> dict[str, Any]:
    return {"name": name, "in": entered, "out": left, "races": races, "wall_s": wall_s}


def _card(index: int) -> dict[str, Any]:
    return card(index, f"coast-s{index % 4}-{(index + 1) * 2500 // 1000:05d}k")


def _pareto(entrant: str, skill: float, has_lap: bool, rng: np.random.Generator) -> dict[str, Any]:
    return {
        "entrant": entrant,
        "lap_s": 88.0 + 7.0 * float(np.exp(-0.6 * skill + 0.6 * rng.normal())) if has_lap else None,
        "off_course_share": min(0.95, 0.02 * float(np.exp(-0.8 * skill + 0.9 * rng.normal()))),
        "contacts_per_km": float(0.3 * np.exp(0.25 * skill + 0.6 * rng.normal())),
        "nondominated_probability": float(rng.uniform(0.0, 0.05)) if has_lap else 0.0,
        "survives": False,
        "races": 4,
    }


def _front(pareto: list[dict[str, Any]]) -> list[int]:
    drivers = [i for i, row in enumerate(pareto) if row["lap_s"] is not None]
    costs = np.array(
        [[pareto[i][key] for key in ("lap_s", "off_course_share", "contacts_per_km")] for i in drivers]
    )
    return [i for i, cost in zip(drivers, costs, strict=True) if not (costs < cost).all(axis=1).any()]


def _objectives(row: dict[str, Any]) -> list[dict[str, Any]]:
    units = {"lap_s": "s", "off_course_share": "1", "contacts_per_km": "1/km"}
    return [
        {
            "entrant": row["entrant"],
            "objective": name,
            "source": "time_trial" if name == "lap_s" else "race",
            "value": row[name],
            "unit": unit,
            "goal": "min",
            "runs": 4,
        }
        for name, unit in units.items()
    ]


def _rated(entrant: str, place: int) -> dict[str, Any]:
    strength = {"bradley_terry": 1.0 - place, "plackett_luce": 0.5 - place}
    return {"entrant": entrant, "bradley_terry_rank": place + 1, "plackett_luce_rank": place + 1} | strength


def _skill(entrant: str, test: str, skill: float, rng: np.random.Generator) -> dict[str, Any]:
    points = float(np.clip(55 + 9 * skill + 9 * rng.normal(), 0, 100))
    return {
        "entrant": entrant,
        "test": test,
        "measure": points / 4,
        "unit": "s" if test == "hot_lap" else "places",
        "points": points,
        "points_low": points - 4.0,
        "points_high": points + 4.0,
        "runs": 24,
    }


def _battery(ids: list[str], skills: list[dict[str, Any]], finalists: int) -> list[dict[str, Any]]:
    sums = {entrant: sum(row["points"] for row in skills if row["entrant"] == entrant) for entrant in ids}
    half = 11.0
    return [
        {
            "entrant": entrant,
            "points": points,
            "points_low": points - half,
            "points_high": points + half,
            "rank": 1 + sum(other - half > points + half for other in sums.values()),
            "worst_rank": sum(other + half >= points - half for other in sums.values()),
            "shortlisted": entrant in ids[:finalists],
        }
        for entrant, points in sums.items()
    ]


def _ranking(final: list[str], strength: dict[str, float], rng: np.random.Generator) -> list[dict[str, Any]]:
    half = 0.75
    points = {entrant: TEAM_MEAN + strength[entrant] + float(rng.normal(0, 0.2)) for entrant in final}
    rows = []
    for entrant, value in points.items():
        rate = float(rng.uniform(0.05, 0.6))
        rank = 1 + sum(other - half > value + half for other in points.values())
        worst = sum(other + half >= value - half for other in points.values())
        rows.append(
            ranked(entrant, rank, value, half, worst_rank=worst, faults=int(rng.random() < 0.2) * 3)
            | {"contacts_per_km": rate, "contacts_low": rate * 0.8, "contacts_high": rate * 1.25}
        )
    return rows


def _matchups(final: list[str], strength: dict[str, float], rng: np.random.Generator) -> list[dict[str, Any]]:
    rows = []
    for entrant in final:
        for opponent in final:
            if entrant == opponent:
                continue
            difference = 2 * (strength[entrant] - strength[opponent]) / 1.6
            rows.append(
                {
                    "entrant": entrant,
                    "opponent": opponent,
                    "pairs": 40,
                    "points_per_race": TEAM_MEAN + difference / 2,
                    "difference": difference,
                    "difference_low": difference - 2.2,
                    "difference_high": difference + 2.2,
                    "contacts_per_km": float(rng.uniform(0.05, 0.6)),
                }
            )
    return rows


def _result(entrant: str, race: int, car: int, match: str) -> dict[str, Any]:
    return {
        "match": match,
        "stage": "tournament",
        "test": "race_4v4",
        "race": race,
        "seed": 1000 + race // 2,
        "mirrored": bool(race % 2),
        "car": car,
        "slot": car + 1,
        "entrant": entrant,
        "team": car % 2,
        "place": car + 1,
        "points": (10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0)[car % 8],
        "laps": 5,
        "ending": "finished",
        "race_time_s": 471.3 + car,
        "driven_s": 471.3 + car,
        "distance_m": 22500.0,
        "best_lap_s": 92.4 + car / 10,
        "off_course_s": 0.4,
        "wall_s": 0.0,
        "contacts": 2,
        "contacts_faster_behind": 1,
        "contacts_at_fault": car % 2,
        "penalties": car % 2,
    }

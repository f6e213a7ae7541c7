"""Blind drives: letters that tell nothing, what follows from the answers, and who may not drive."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from nathlon.arena.entrant import Entrant
from nathlon.arena.store import Store
from nathlon.lab.drive.blind import BlindTest, letters, read_answers
from nathlon.lab.drive.choice import Choice
from nathlon.selection.committee import close, vote
from nathlon.selection.committee.ballots import Ballot
from nathlon.selection.committee.decision import CommitteeDecision, describe
from nathlon.selection.committee.drives import ballot, opinions
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.events import Answers, Drove
from nathlon.sim.errors import InputError
from tests.support.blind_runs import RUN, blind_run
from tests.support.command_line import nathlon, refused
from tests.support.drives import choice


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Entrant]]:
    folder = tmp_path_factory.mktemp("run")
    return folder, blind_run(folder)


def blind(folder: Path, member: str = "ann") -> BlindTest:
    return BlindTest(folder, folder / "store.sqlite", member)


def two(**other: Any) -> Choice:
    return choice(**{"name": "x", "opponents": (0, 2), **other})


def answers(letter: str, again: int, other: int = 3) -> Answers:
    return Answers(entrant=letter.lower(), letter=letter, again=again, fair=other, room=other, beatable=1)


def drove(*said: Answers, better: str | None = None) -> Drove:
    return Drove(
        decision="d", member="ann", answers=said, better=better, text="", recording="r.mcap", moments=()
    )


def test_letters_are_drawn_for_each_driver_and_stay() -> None:
    entrants = [f"entrant {i}" for i in range(6)]
    drawn = [tuple(letters(f"{RUN}\nmember {i}", entrants).values()) for i in range(50)]
    assert len(set(drawn)) > 45
    assert {order[0] for order in drawn} == set(entrants)
    assert letters("x", entrants) == letters("x", entrants[::-1])
    with pytest.raises(InputError, match="27 finalists, expected at most 26"):
        letters("x", [str(i) for i in range(27)])


def test_the_same_driver_finds_the_same_letters(run: tuple[Path, list[Entrant]]) -> None:
    folder, _ = run
    sources = {
        member: [one.source for one in blind(folder, member).offer.opponents]
        for member in ("ann", "bob", "cy")
    }
    assert sources["ann"] == [one.source for one in blind(folder).offer.opponents]
    assert len(set(map(tuple, sources.values()))) > 1
    assert [one.name for one in blind(folder).offer.opponents] == ["A", "B", "C"]


def test_who_would_be_raced_again_is_approved_and_preferences_order() -> None:
    """B is preferred to A and A to C; C and D would not be raced again, D was preferred to C."""
    said = opinions(
        [
            drove(answers("A", 5), answers("B", 4), better="b"),
            drove(answers("A", 4), answers("C", 3), better="a"),
            drove(answers("C", 3), answers("D", 1), better="d"),
        ]
    )
    assert ballot(said) == Ballot(("b", "a"), ("b", "a", "d", "c"))
    assert next(one for one in said if one.letter == "A").means["again"] == 4.5


def test_ties_go_by_the_answers() -> None:
    said = opinions([drove(answers("A", 4, 2), answers("B", 4, 3)), drove(answers("C", 5), answers("D", 5))])
    assert ballot(said).rank == ("c", "d", "b", "a")


def test_what_is_planned_names_letters_alone(run: tuple[Path, list[Entrant]]) -> None:
    test = blind(run[0])
    made = test.plan(test.check(two(cars=4, seat=4)))
    assert made.grid == ("A", "C", "A", "human:ann")
    for fields in ({"opponents": (0,)}, {"opponents": (0, 1, 2)}, {"cars": 2}):
        with pytest.raises(InputError, match="expected two and at least three"):
            test.check(two(**fields))


def test_a_finalist_that_is_lost_is_not_named(tmp_path: Path) -> None:
    finalists = blind_run(tmp_path)
    test = blind(tmp_path)
    for one in finalists:
        Path(one.source).write_bytes(b"no weights")
    with pytest.raises(InputError) as refusal:
        test.plan(test.check(two()))
    assert str(refusal.value) == "a finalist cannot be loaded, expected the files of the run"
    with pytest.raises(InputError, match="weights"):
        blind(tmp_path)


def test_while_a_member_drives_nothing_is_told_of_their_drives(tmp_path: Path) -> None:
    finalists = blind_run(tmp_path)
    ids = [one.id for one in finalists]
    said = tuple(Answers(entrant=x, letter="A", again=4, fair=4, room=4, beatable=4) for x in ids[:2])
    with Store.open(tmp_path / "store.sqlite") as store:
        event_log = EventLog(store, RUN)

        def asked() -> CommitteeDecision:
            return event_log.decisions()["selection"]

        event_log.add(drove(*said).model_copy(update={"decision": asked().name}))
        assert asked().waits_for == 1, "drives are no ballot"
        assert describe(asked()).drives == ()
        vote(event_log, asked(), "bob", Ballot((), ()), "none of them")
        assert describe(asked()).drives == ()
        close(event_log, asked(), "ann")
        [told] = describe(asked()).drives
        assert told["answers"][1]["entrant"] == ids[1]
    log = nathlon("committee", "store.sqlite", "log", cwd=tmp_path).stdout
    assert "ann raced A and A without knowing who they are" in log


def test_who_cannot_drive_blind_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / RUN
    blind_run(folder)
    with Store.open(folder / "store.sqlite") as store:
        event_log = EventLog(store, RUN)
        vote(event_log, event_log.decisions()["selection"], "bob", Ballot((), ()), "none of them")
    with Store(tmp_path / "other" / "store.sqlite") as store:
        store.begin_run("other", {})

    def drive(*arguments: str) -> Any:
        return nathlon("drive", "--blind", "--no-open", *arguments, cwd=tmp_path)

    refused(drive("--run", RUN), "--blind: expected --run FOLDER and --driver NAME too")
    refused(
        drive("--run", RUN, "--driver", "ann", "--car", "gt3"), "--car gt3: expected what the run has raced"
    )
    refused(nathlon("drive", "--driver", "ann", cwd=tmp_path), "--driver, --store: expected with --blind")
    refused(
        drive("--run", RUN, "--driver", "eve"), "'eve' is not on the committee, expected one of ann, bob, cy"
    )
    refused(drive("--run", RUN, "--driver", "bob"), "bob has voted on selection-", "not yet cast")
    refused(drive("--run", "other", "--driver", "ann"), "run 'other' has no finalists to compare")
    refused(drive("--run", "none", "--driver", "ann"), "none/store.sqlite")
    nathlon("committee", f"{RUN}/store.sqlite", "decide", "--member", "ann", cwd=tmp_path)
    refused(drive("--run", RUN, "--driver", "ann"), "is closed; reopen it first")


def test_answers_that_do_not_fit_are_refused(run: tuple[Path, list[Entrant]]) -> None:
    test = blind(run[0])
    with pytest.raises(InputError, match="there is no race to answer for"):
        test.answer({})
    with pytest.raises(InputError, match="A, B, C not met yet, expected each letter at least once"):
        test.cast()
    told = json.dumps(test.standing())
    assert not any(one.name in told or one.id[:8] in told for one in run[1])
    told_scores = {"again": 4, "fair": 4, "room": 4, "beatable": 4}
    one_met: dict[str, Any] = {"scores": {"A": told_scores, "B": None}, "better": None, "text": ""}
    assert read_answers(one_met, ["A", "B"]).scores["B"] is None
    with pytest.raises(InputError, match="better names one of two, expected null where only one was met"):
        read_answers(one_met | {"better": "A"}, ["A", "B"])
    with pytest.raises(InputError, match="expected some for A and C"):
        read_answers(one_met, ["A", "C"])

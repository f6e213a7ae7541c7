"""The committee at the command line: the question, votes, the decision, and what was said."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from nathlon.arena.store import Store
from nathlon.commands.committee import committee
from nathlon.commands.selection import put_again
from nathlon.selection.committee import ask as put
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.rules import CommitteeSettings
from nathlon.sim.errors import InputError
from tests.nathlon.test_committee import ranking
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused
from tests.support.committees import NAMES, PEOPLE, RUN, ask, entrants, ids, results


class Terminal:
    """The command line on one store."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __call__(self, *arguments: str, options: Sequence[str] = ()) -> str:
        """What a command prints; raises what it raises."""
        result = CliRunner().invoke(
            committee, [*options, str(self._path), *arguments], catch_exceptions=False, standalone_mode=False
        )
        return result.stdout

    def json(self, *arguments: str) -> Any:
        """What a command prints as JSON."""
        return json.loads(self(*arguments, "--json"))


@pytest.fixture
def terminal(tmp_path: Path) -> Terminal:
    """With a question that is open."""
    path = tmp_path / "store.sqlite"
    with Store(path) as store:
        store.begin_run(RUN, {})
        ask(EventLog(store, RUN), PEOPLE)
    return Terminal(path)


def test_a_committee_meets_at_the_terminal(terminal: Terminal) -> None:
    (decision,) = terminal.json("show")
    assert (decision["open"], decision["waits_for"], decision["ballots"]) == (True, 2, 1)
    after = terminal.json("vote", "--member", "ann", "--rank", "cedar, delta", "--reason", "calm")
    assert after["said"][-1]["approve"] == list(ids("cd"))
    assert after["said"][-1]["evidence"] == decision["evidence"]["digest"]
    terminal("vote", "--member", "bob", "--approve", "delta,cedar-012", "--rank", "delta", "--reason", "fast")
    terminal(
        "compare", "--member", "bob", "--better", "cedar", "--worse", "delta", "--reason", "on second sight"
    )
    closed = terminal.json("decide", "--member", "ann")
    assert [s["name"] for s in closed["standings"] if s["chosen"]] == ["cedar", "delta"]
    assert "open" in terminal("reopen", "--member", "bob", "--reason", "new videos")
    shown = terminal("show")
    assert " 1 to 4 " in shown
    for part in ("shortlist-", "birch", "bob prefers cedar to delta: on second sight", "Agreement"):
        assert part in shown
    assert [entry["event"] for entry in terminal.json("log")] == [
        "opened",
        "voted",
        "voted",
        "voted",
        "compared",
        "closed",
        "reopened",
    ]
    assert "reopened by bob: new videos" in terminal("log")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("vote", "--member", "ann", "--rank", "elm", "--reason", "x"),
            r"^'elm' is not a candidate, expected",
        ),
        (("vote", "--member", "eve", "--rank", "amber", "--reason", "x"), r"^'eve' is not on the committee"),
        (("vote", "--member", "ann", "--rank", "amber", "--reason", ""), r"^--reason: is empty"),
        (("decide", "--member", "ann"), r"waits for 2 more"),
        (("decide", "--member", "eve"), r"^'eve' is not on the committee"),
        (("reopen", "--member", "ann", "--reason", "x"), r"^no decision is closed"),
        (
            ("decide", "--member", "ann", "--question", "selection"),
            r"^the committee has not been asked for the selection$",
        ),
    ],
)
def test_a_wrong_command_is_one_sentence(
    terminal: Terminal, arguments: tuple[str, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        terminal(*arguments)


def test_the_run_may_be_named(terminal: Terminal, tmp_path: Path) -> None:
    with Store.open(tmp_path / "store.sqlite") as store:
        store.begin_run("next", {})
    assert "has not been asked" in terminal("show")
    assert "shortlist-" in terminal("show", options=("--run", RUN))
    with pytest.raises(InputError, match=r"no run 'noon', the last is 'next'$"):
        terminal("show", options=("--run", "noon"))


def test_only_an_existing_store_has_a_committee(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.sqlite: no such store"):
        Terminal(tmp_path / "none.sqlite")("show")
    Store(tmp_path / "empty.sqlite").close()
    with pytest.raises(InputError, match=r"empty.sqlite: holds no run"):
        Terminal(tmp_path / "empty.sqlite")("show")


def test_a_demo_with_a_committee_puts_its_question_again(terminal: Terminal, tmp_path: Path) -> None:
    store = str(tmp_path / "store.sqlite")
    with Store.open(store) as opened:
        tables = {"ranking": ranking({"amber": 21.0, "birch": 20.0})}
        settings = CommitteeSettings(members=("ann",))
        put(EventLog(opened, RUN), "selection", entrants(NAMES[:2]), tables, results(), settings)
    assert "selection" in terminal("show")
    for _ in range(2):
        put_again(store, "ann")
    assert [decision["open"] for decision in terminal.json("show")] == [True, True]
    assert [entry["event"] for entry in terminal.json("log")].count("reopened") == 1
    # Both are open now, so that one has to be named.
    with pytest.raises(InputError, match=r"^--question is not given, expected one that is open"):
        terminal("decide", "--member", "ann")


def test_a_demo_says_who_cannot_be_on_its_committee(tmp_path: Path) -> None:
    refused(command("demo", "--committee", "ann,ann", "--out", "out", cwd=tmp_path), "--committee: ", "twice")
    assert not list(tmp_path.iterdir())

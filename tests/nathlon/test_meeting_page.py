"""The committee's room in browsers: two at once, beside the terminal."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from typer.testing import CliRunner

from nathlon.arena.store import Store
from nathlon.commands.committee import committee
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.events import Voted
from tests.support.committees import PEOPLE, RUN, ask, ids
from tests.support.driven_page import serious
from tests.support.meetings import Window, met


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """With an open question that waits for two people."""
    path = tmp_path / "store.sqlite"
    with Store(path) as store:
        store.begin_run(RUN, {})
        ask(EventLog(store, RUN), PEOPLE)
    return path


def at_terminal(store: Path, rank: str, reason: str) -> None:
    """Have bob vote at the terminal."""
    words = [str(store), "vote", "--member", "bob", "--rank", rank, "--reason", reason]
    assert CliRunner().invoke(committee, words).exit_code == 0


def test_two_browsers_and_the_terminal_decide_together(browser: Browser, store: Path) -> None:
    with met(store) as meeting:
        ann, bob = (Window(browser, meeting.url(member)) for member in ("ann", "bob"))
        assert serious(ann.page) == []
        ann.picture("questions")
        standings = ann.page.locator("[aria-label^=Standings] tbody tr").all_inner_texts()
        assert {row.split("\t")[1] for row in standings} == {"1 to 4"}
        assert ann.page.locator("h2").first.inner_text() == "Who is shortlisted?"
        # The address bar does not show the token.
        assert ann.page.url == f"{meeting.address.origin}/#/questions"
        assert ann.page.locator("button:has-text('Decide')").is_disabled()
        bob.page.locator("form.ballot input[type=text]").fill("half a sentence")
        ann.ballot({"cedar": 1, "delta": 2}, ("cedar", "delta"), "calm <b>in traffic</b>")
        ann.shows("Your ballot is cast.", "#told")
        bob.shows("calm <b>in traffic</b>")
        bob.shows("waits for 1 more member")
        # What somebody else says leaves alone what is being typed.
        assert bob.page.locator("form.ballot input[type=text]").input_value() == "half a sentence"

        bob.page.get_by_label("Place of amber").fill("1")
        bob.page.get_by_label("Place of birch").fill("1")
        bob.page.click("text=Cast my ballot")
        bob.shows("Two have place 1.")
        bob.ballot({"amber": 1, "birch": 2}, ("birch",), "fast")
        bob.shows("rank puts amber before an approved entrant", "#told")
        bob.ballot({"amber": 2, "birch": 1}, ("birch",), "fast")
        ann.shows("can be decided")

        # From the terminal, and into it.
        at_terminal(store, "delta, cedar", "slow")
        ann.shows("Order: delta > cedar")
        bob.until("document.querySelector('[aria-label=\"Place of delta\"]').value === '1'")
        bob.page.click("text=Say only which of two you prefer")
        better, worse = bob.page.locator("details[open] select").all()
        better.select_option(label="amber")
        worse.select_option(label="birch")
        bob.page.locator("details[open] input").fill("on second sight")
        bob.page.click("text=Say so")
        ann.shows("Prefers amber to birch")
        shown = json.loads(CliRunner().invoke(committee, [str(store), "show", "--json"]).stdout)[0]
        assert [(said["member"], said["reason"]) for said in shown["said"][1:]] == [
            ("ann", "calm <b>in traffic</b>"),
            ("bob", "slow"),
            ("bob", "on second sight"),
        ]

        ann.page.click("button:has-text('Decide')")
        bob.shows("seats · decided")
        assert bob.page.locator("tr.chosen th").all_text_contents() == [
            "cedarshortlisted",
            "deltashortlisted",
        ]
        assert serious(bob.page) == []
        bob.picture("decided")
        bob.page.click("text=Put the question again")
        bob.page.locator("details[open] input").fill("new videos")
        bob.page.click("text=Ask again")
        ann.shows("can be decided")
        ann.page.click("#views >> text=Log")
        ann.shows("reopened by bob: new videos", "#log")
        assert "ann approves cedar, delta, ranks cedar > delta: calm" in ann.page.locator("#log").inner_text()
        ann.picture("log")
        ann.page.set_viewport_size({"width": 390, "height": 800})
        words = ann.page.locator("#log td:last-child").first.bounding_box()
        assert words is not None
        assert words["width"] > 300
        for view in ("Questions", "Report", "Races", "Log", "Work", "History"):
            ann.page.click(f"#views >> text={view}")
            assert ann.page.evaluate("document.documentElement.scrollWidth") == 390, view
        assert all(meeting.url(name).partition("#")[2] not in url for name in ("ann", "bob")
                   for window in (ann, bob) for url in window.requests)  # fmt: skip
        ann.close()
        bob.close()
    with Store.open(store) as opened:
        votes = [e.event for e in EventLog(opened, RUN).entries() if isinstance(e.event, Voted)]
    assert [vote.rank for vote in votes if vote.member == "bob"] == [ids("ba"), ids("dc")]


def test_who_is_not_on_the_committee_is_shown_nothing_to_press(browser: Browser, store: Path) -> None:
    with met(store, members=("eve",)) as meeting:
        window = Window(browser, meeting.url("eve"))
        window.shows("You are not on this committee: you can read, but not vote, decide or ask again.")
        assert window.page.locator("#questions button:visible, #questions summary:visible").count() == 0
        assert serious(window.page) == []
        window.picture("reader")
        window.close()


def test_the_report_is_of_now_and_follows_the_run(browser: Browser, store: Path) -> None:
    with met(store) as meeting:
        window = Window(browser, meeting.url("ann"))
        window.page.click("#views >> text=Report")
        report = window.page.frame_locator("#report iframe")
        report.locator("text=the committee is asked about the shortlist").wait_for()
        report.locator("nav >> text=Committee").click()
        report.locator("text=Who goes on").or_(report.locator("text=Who is shortlisted?")).first.wait_for()
        at_terminal(store, "delta", "room at 4")
        # The view that is being read stays.
        report.locator("text=room at 4").wait_for()
        window.picture("report")
        assert serious(window.page) == []
        with Store.open(store) as opened:
            opened.begin_run("next", {})
            opened.put_fact("next", "progress", {"stage": "pareto", "done": 3, "total": 40})
        window.shows("filter: 3 of 40 matches", "#stands")
        report.locator("text=under way: filter, 3 of 40 matches").wait_for()
        window.page.get_by_label("Run").select_option(RUN)
        window.page.click("#views >> text=Questions")
        window.shows("Who is shortlisted?")
        window.close()


def test_a_race_plays_in_the_report_s_frame_and_has_no_part_in_the_room(
    browser: Browser, store: Path
) -> None:
    folder = store.parent
    for name in ("report", "races", "replays"):
        (folder / name).mkdir()
    reach = "try { parent.document.title = 'reached'; } catch {} document.title = origin;"
    (folder / "replays" / "final.html").write_text(f"<h1>A race</h1><script>{reach}</script>", "utf-8")
    with met(store) as meeting:
        window = Window(browser, meeting.url("ann"))
        window.page.click("#views >> text=Report")
        report = window.page.frame_locator("#report iframe")
        report.locator("text=the committee is asked").wait_for()
        frame = window.page.frames[1]
        frame.evaluate("location.href = '../replays/final.html'")
        report.locator("text=A race").wait_for()
        assert window.page.frames[1].evaluate("document.title") == "null"
        assert window.page.title() == "nathlon: the committee's room"
        # What is said meanwhile leaves the race alone, and is in the report when somebody goes back to it.
        at_terminal(store, "delta", "room at 4")
        window.until("document.querySelector('#report').dataset.stale")
        window.page.evaluate("history.back()")
        report.locator("nav >> text=Committee").click()
        report.locator("text=room at 4").wait_for()
        window.page.context.close()


def test_an_address_of_nobody_is_told_so(browser: Browser, store: Path) -> None:
    with met(store) as meeting:
        stranger = Window(browser, f"{meeting.address.origin}/#{'x' * 43}")
        stranger.shows("This address is of no member", "#stands")
        assert "amber" not in stranger.page.content()
        stranger.close()

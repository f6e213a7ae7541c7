"""Blind drives from the committee's room, in a browser: from the first race to the decision."""

from __future__ import annotations

import json
from pathlib import Path

from playwright.sync_api import Browser, WebSocket

from nathlon.arena.store import Store
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.events import Drove, Voted
from tests.support.blind_runs import RUN, blind_run
from tests.support.command_line import nathlon
from tests.support.driven_page import MAP, DriveFromRoom, answered, raced, serious
from tests.support.meetings import Window, met
from tests.support.opened_page import picture


def test_a_blind_test_from_the_first_race_to_the_decision(browser: Browser, tmp_path: Path) -> None:
    finalists = blind_run(tmp_path)
    (tmp_path / "report").mkdir()
    sent: list[str | bytes] = []

    def listen(socket: WebSocket) -> None:
        socket.on("framereceived", lambda frame: sent.append(frame))

    with met(tmp_path / "store.sqlite", pace=6.0) as meeting:
        ann = Window(browser, meeting.url("ann"), script=MAP)
        ann.picture("blind")
        ann.page.click("text=Begin a blind test drive")
        drive = DriveFromRoom(ann.page)
        drive.page.on("websocket", listen)
        drive.page.reload()
        drive.until("document.querySelector('#choice button.first')")
        assert serious(drive.page) == []
        drive.picture("blind-menu")
        assert drive.page.locator("[name=opponent]:checked").count() == 2
        raced(drive, interrupted=True)
        rows = drive.page.locator("#result td:nth-child(2)").all_inner_texts()
        assert set(rows) == {"A", "B", "ann"}
        drive.picture("blind-result")
        drive.page.click("#result >> text=Answer")
        assert serious(drive.page) == []
        # The browser goes away, and the questions wait for it.
        drive.page.reload()
        drive.until("document.getElementById('questions').open")
        assert "You marked" in drive.page.locator("#questions").inner_text()
        answered(drive, "B", {"A": (2, 3, 3, 4), "B": (5, 4, 5, 2)}, "B gave way — A closed the door.")
        drive.until("document.getElementById('blind').textContent.includes('Meet C in a race first')")
        raced(drive)
        rows = drive.page.locator("#result td:nth-child(2)").all_inner_texts()
        pair = sorted(set(rows) - {"ann"})
        assert pair[1] == "C"
        drive.page.click("#result >> text=Answer")
        answered(drive, None, {"C": (4, 4, 4, 4)}, missed=pair[0])
        drive.until("!document.querySelector('#blind button').disabled")
        drive.picture("blind-ballot")
        told = [part if isinstance(part, str) else part.decode("latin-1") for part in sent]
        page = drive.page.content()
        drive.page.click("text=Cast my ballot")
        drive.until("document.getElementById('choice').hidden")
        drive.picture("blind-cast")
        shown = drive.page.locator("#blind").inner_text()
        assert all(one.name in shown for one in finalists)
        bob = Window(browser, meeting.url("bob"))
        bob.shows("can be decided")
        bob.picture("blind-told")
        drive.page.click("text=Back to the committee's room")
        ann.shows("can be decided")
        assert ann.page.get_by_text("Begin a blind test drive").count() == 0
        with ann.page.context.expect_page() as opened:
            ann.page.locator(".moments a").first.click()
        played = opened.value
        played.wait_for_selector("body[data-ready=yes]")
        picture(played, "room-moment")
        bob.page.click("button:has-text('Decide')")
        ann.shows("1 seat · decided")
        ann.picture("blind-decided")
        ann.close()
        bob.close()

    files = " ".join(str(path.relative_to(tmp_path)) for path in (tmp_path / "drives").rglob("*"))
    assert any('"type": "result"' in part for part in told)
    for one in finalists:
        for secret in (one.name, one.id[:8], one.source, one.algorithm, "safetensors", str(tmp_path)):
            assert not any(secret in part for part in [*told, page, files]), secret

    with Store.open(tmp_path / "store.sqlite") as store:
        entries = [entry.event for entry in EventLog(store, RUN).entries()]
    drives = [event for event in entries if isinstance(event, Drove)]
    cast = next(event for event in entries if isinstance(event, Voted) and event.member == "ann")
    by_letter = {answer.letter: answer.entrant for drove in drives for answer in drove.answers}
    assert (drives[0].better, drives[1].better) == (by_letter["B"], None)
    assert [answer.letter for answer in drives[1].answers] == ["C"]
    assert drives[0].text == "B gave way — A closed the door."
    [moment] = drives[0].moments
    assert moment.nearest in by_letter.values()
    assert set(cast.approve) == {by_letter["B"], by_letter["C"]}
    assert cast.rank[-1] == by_letter["A"]
    assert f"{moment.time_s:.1f} s near" in cast.reason
    assert all(drove.recording in cast.reason and (tmp_path / drove.recording).exists() for drove in drives)

    done = nathlon("committee", "store.sqlite", "show", "--json", cwd=tmp_path)
    [decided] = json.loads(done.stdout)
    assert not decided["open"]
    assert len(decided["drives"]) == 2
    assert {said["member"] for said in decided["said"]} == {"ann", "rule:ranking"}

"""The room's API: answers are as their description says, and only members get any; who steers says so."""

from __future__ import annotations

import json
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from jsonschema import Draft202012Validator
from playwright.sync_api import Browser
from websockets.sync.client import connect
from websockets.typing import Origin

from nathlon.arena.claimant import owner_name
from nathlon.arena.control import control
from nathlon.arena.entrant import entrants_table
from nathlon.arena.results import RANKING
from nathlon.arena.store import Queued, Store
from nathlon.lab.serve.server import MeetingServer
from nathlon.results.forecast import Forecast, StageForecast
from nathlon.results.summary import Sent
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.nightly.night import NIGHT
from tests.support.committees import PEOPLE, ask, entrants
from tests.support.driven_page import serious
from tests.support.meetings import Window, met
from tests.support.selections import build
from tests.support.sockets import PATIENCE_S

FIRST, LAST = f"{NIGHT}0001", f"{NIGHT}0002"
DIGEST = "ab" * 32


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a night that has ended, one under way, somebody at work, and a match that waits."""
    path = tmp_path_factory.mktemp("work") / "store.sqlite"
    amber, birch = entrants(("amber", "birch"))
    with Store(path) as store:
        store.begin_run(FIRST, {})
        store.put_table(FIRST, "entrants", entrants_table([amber, birch]))
        ranked = {"entrant": amber.id, "rank": 1, "points_per_race": 21.5, "points_low": 20.0}
        ranking = pl.DataFrame([ranked | {"points_high": 23.0}], schema=RANKING)
        store.put_table(FIRST, "ranking", ranking)
        sent = (Sent(name=amber.name, entrant=amber.id),)
        summary = build(np.random.default_rng(0), 8, 2).summary.model_copy(update={"sent": sent})
        store.put_fact(FIRST, "summary", summary.model_dump(mode="json"))
        store.put_fact(FIRST, "outcome", {"code": 0, "reason": "amber is sent.", "told": True})
        store.end_run(FIRST, "done")
        store.begin_run(LAST, {})
        stages = (
            StageForecast(name="pareto", entrants=9, races=90, most_races=90, core_s=100.0),
            StageForecast(name="battery", entrants=9, races=90, most_races=90, core_s=50.0),
            StageForecast(name="tournament", entrants=9, races=90, most_races=90, core_s=50.0),
        )
        expected = Forecast(
            newcomers=9, earlier=1, workers=2, stages=stages, deviation=None, power=0.8, budgets=()
        )
        store.put_fact(LAST, "forecast", expected.model_dump(mode="json"))
        store.put_fact(LAST, "progress", {"stage": "battery", "done": 5, "total": 10})
        ask(EventLog(store, LAST), PEOPLE)
        store.attend(owner_name(), 2, 600.0)
        facts = {"world": "racing", "circuit": "lindenring", "car": "gt3", "scenario": "sprint"}
        store.enqueue([Queued("cd" * 32, DIGEST, {}, [])], {DIGEST: facts})
    return path


@pytest.fixture(scope="module")
def server(store: Path) -> Iterator[MeetingServer]:
    with met(store) as meeting:
        yield meeting


def token(server: MeetingServer) -> str:
    return server.url("ann").partition("#")[2]


def get(server: MeetingServer, path: str, **headers: str) -> tuple[int, Any]:
    connection = HTTPConnection("127.0.0.1", server.address.port, timeout=PATIENCE_S)
    connection.request("GET", path, headers={"Host": server.address.authority, **headers})
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, json.loads(text) if answer.status == 200 else text


def own(server: MeetingServer, path: str) -> Any:
    status, told = get(server, path, Authorization=f"Bearer {token(server)}")
    assert status == 200
    return told


def test_every_answer_is_as_the_description_says(server: MeetingServer) -> None:
    described = own(server, "/api/openapi.json")
    assert described["openapi"] == "3.1.0"
    for path, methods in described["paths"].items():
        assert set(methods) == {"get"}
        schema = methods["get"]["responses"]["200"]["content"]["application/json"]["schema"]
        validator = Draft202012Validator(schema | {"components": described["components"]})
        told = own(server, f"{path}?search=a" if methods["get"]["parameters"] else path)
        assert told
        validator.validate(told)
        assert not validator.is_valid({"paused": "perhaps"})


def test_it_tells_who_works_what_waits_and_when_the_night_ends(server: MeetingServer) -> None:
    work = own(server, "/api/work")
    assert [(one["processes"], one["seen_at"] is not None) for one in work["workers"]] == [(2, True)]
    assert [(one["scenario"], one["matches"]) for one in work["queue"]] == [("sprint", 1)]
    assert work["under_way"]["name"] == LAST
    assert (work["under_way"]["done"], work["under_way"]["total"]) == (5, 10)
    assert work["under_way"]["ends_at"] is not None
    last, first = own(server, "/api/nights")
    assert (last["name"], last["sent"]) == (LAST, [])
    assert (first["reason"], first["sent"][0]["points"], first["sent"][0]["high"]) == (
        "amber is sent.",
        21.5,
        23.0,
    )
    [found] = own(server, "/api/checkpoints?search=AMBER.safe")
    assert (found["run"], found["rank"], found["points_per_race"]) == (FIRST, 1, 21.5)
    assert own(server, "/api/checkpoints?search=%25") == []


@pytest.mark.parametrize("path", ["/api/work", "/api/openapi.json", "/api/checkpoints?search=a"])
@pytest.mark.parametrize("given", [None, "Bearer x", "{token}", "Basic {token}"])
def test_without_a_members_token_there_is_no_answer(
    server: MeetingServer, path: str, given: str | None
) -> None:
    headers = {} if given is None else {"Authorization": given.format(token=token(server))}
    assert get(server, path, **headers) == (403, "")


def test_a_member_pauses_and_what_is_gone_cannot_be_put_first(server: MeetingServer, store: Path) -> None:
    with connect(f"{server.address.socket}/room", origin=Origin(server.address.origin)) as connection:
        connection.send(token(server))
        for first, answer in (("0" * 64, "refused"), (DIGEST, "done")):
            connection.send(json.dumps({"type": "steer", "paused": True, "first": first}))
            while (words := json.loads(connection.recv(timeout=PATIENCE_S)))["type"] not in (
                "refused",
                "done",
            ):
                pass
            assert words["type"] == answer
    with Store.open(store) as opened:
        said = control(opened)
    assert (said.paused, said.first, said.by) == (True, DIGEST, "ann")
    assert own(server, "/api/work")["queue"][0]["first"]


def test_who_steers_one_thing_leaves_the_others_as_they_are(server: MeetingServer, store: Path) -> None:
    """A page that was shown before somebody paused the work would have it go on."""
    with (
        connect(f"{server.address.socket}/room", origin=Origin(server.address.origin)) as connection,
        Store.open(store) as opened,
    ):
        connection.send(token(server))
        for said, expected in (
            ({"paused": False, "first": None}, (False, None)),
            ({"paused": True}, (True, None)),
            ({"first": DIGEST}, (True, DIGEST)),
            ({"paused": False}, (False, DIGEST)),
            ({"first": None}, (False, None)),
        ):
            connection.send(json.dumps({"type": "steer", **said}))
            while json.loads(connection.recv(timeout=PATIENCE_S))["type"] != "done":
                pass
            now = control(opened)
            assert (now.paused, now.first) == expected


@pytest.mark.parametrize("search", ["a%00b", "a" * 501])
def test_a_search_that_no_store_can_make_is_refused(server: MeetingServer, search: str) -> None:
    status, _ = get(server, f"/api/checkpoints?search={search}", Authorization=f"Bearer {token(server)}")
    assert status == 400


def test_the_page_shows_and_steers_the_work(server: MeetingServer, store: Path, browser: Browser) -> None:
    ann = Window(browser, server.url("ann"))
    ann.page.click("#views a[href='#/work']")
    ann.shows("sprint", "#work")
    assert serious(ann.page) == []
    with Store.open(store) as opened:
        before = control(opened).paused
    ann.page.click("#work button >> nth=0")
    ann.shows("Resume" if not before else "Pause", "#work")
    with Store.open(store) as opened:
        assert control(opened).paused is not before
    ann.page.click("#views a[href='#/history']")
    ann.shows("amber is sent.", "#history")
    ann.page.fill("#history input", "birch")
    ann.page.click("#history button")
    ann.shows("birch.safetensors", "#history")
    ann.picture("history")
    ann.close()

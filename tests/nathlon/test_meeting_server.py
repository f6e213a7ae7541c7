"""The server of the committee's room: whom it lets in, what it bears, and what it keeps to itself."""

from __future__ import annotations

import json
import resource
import signal
import ssl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from email.message import Message
from html import unescape
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from nathlon.arena.store import Store
from nathlon.lab.serve.folders import shown_file
from nathlon.lab.serve.server import LARGEST_MESSAGE, MeetingServer
from nathlon.lab.web.address import Address, is_loopback
from nathlon.lab.web.server import tls_context
from nathlon.selection.committee.event_log import EventLog
from nathlon.sim.errors import InputError
from tests.support.command_line import nathlon, refused
from tests.support.committees import PEOPLE, RUN, ask, ids
from tests.support.meetings import met
from tests.support.sockets import CUT, PATIENCE_S, closed


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a run with an open question."""
    folder = tmp_path_factory.mktemp("meeting")
    (folder / "report").mkdir()
    (folder / "races").mkdir()
    (folder / "replays").mkdir()
    (folder / "replays" / "final.html").write_text("<p>a race</p>", "utf-8")
    (folder / "races" / "secret.json").write_text("{}", "utf-8")
    with Store(folder / "store.sqlite") as store:
        store.begin_run(RUN, {})
        ask(EventLog(store, RUN), PEOPLE)
    return folder


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[MeetingServer]:
    with met(folder / "store.sqlite") as meeting:
        yield meeting


LARGE = 250_000_000


def resident() -> int:
    """Bytes that this process has in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def token(server: MeetingServer, member: str = "ann") -> str:
    return server.url(member).partition("#")[2]


def get(server: MeetingServer, path: str, **headers: str) -> tuple[int, Message, str]:
    connection = HTTPConnection("127.0.0.1", server.address.port, timeout=PATIENCE_S)
    connection.request("GET", path, headers={"Host": server.address.authority, **headers})
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, answer.headers, text


@contextmanager
def dial(server: MeetingServer, path: str = "/room", **other: Any) -> Iterator[ClientConnection]:
    facts = {"origin": server.address.origin, "compression": None, "max_size": None} | other
    with connect(f"{server.address.socket}{path}", **facts) as connection:
        yield connection


@contextmanager
def enter(server: MeetingServer, member: str = "ann") -> Iterator[ClientConnection]:
    with dial(server) as connection:
        connection.send(token(server, member))
        assert hear(connection, "welcome")["you"] == member
        yield connection


def hear(connection: ClientConnection, kind: str) -> dict[str, Any]:
    """The next message of a kind; what comes before it is not looked at."""
    while True:
        words: dict[str, Any] = json.loads(connection.recv(timeout=PATIENCE_S))
        if words["type"] == kind:
            return words


def entries(folder: Path) -> int:
    with Store.open(folder / "store.sqlite") as store:
        return len(EventLog(store, RUN).entries())


def test_the_page_holds_no_secret_and_connects_to_its_server_alone(server: MeetingServer) -> None:
    status, headers, text = get(server, "/")
    assert status == 200
    assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    policy = unescape(text.partition('Policy" content="')[2].partition('">')[0])
    assert "default-src 'none'" in policy
    assert f"connect-src {server.address.socket} {server.address.origin};" in policy
    assert "unsafe" not in policy
    assert not any(token(server, member) in text for member in ("ann", "bob"))
    assert "#" not in server.url("ann").partition("#")[0]
    assert get(server, "/elsewhere")[0] == 404


@pytest.mark.parametrize("host", ["localhost:{port}", "evil.example", "127.0.0.1", "127.0.0.1:1"])
@pytest.mark.parametrize("path", ["/", "/enter"])
def test_another_name_of_this_machine_gets_nothing(server: MeetingServer, host: str, path: str) -> None:
    forged = host.format(port=server.address.port)
    status, headers, text = get(server, path, Host=forged, Authorization=f"Bearer {token(server)}")
    assert (status, text) == (403, "")
    assert "Set-Cookie" not in headers


@pytest.mark.parametrize("path", ["/room", f"/drive/{RUN}"])
@pytest.mark.parametrize("origin", ["http://evil.example", "http://localhost:{port}", "null", None])
def test_a_page_of_another_origin_is_not_let_in(server: MeetingServer, origin: str | None, path: str) -> None:
    forged = origin and origin.format(port=server.address.port)
    with pytest.raises(InvalidStatus) as refusal, dial(server, path, origin=forged):
        pass
    assert refusal.value.response.status_code == 403


@pytest.mark.parametrize("path", ["/room", f"/drive/{RUN}"])
@pytest.mark.parametrize("wrong", ["", "x" * 43, b"x" * 43, '{"type": "look"}', "ä"])
def test_without_a_token_nothing_is_told_or_done(
    server: MeetingServer, folder: Path, wrong: str | bytes, path: str
) -> None:
    before = entries(folder)
    with dial(server, path) as connection:
        connection.send(wrong)
        with suppress(ConnectionClosed):
            connection.send(vote(server, folder))
        assert closed(connection) == 4001
    assert entries(folder) == before


def vote(server: MeetingServer, folder: Path, **other: Any) -> str:
    with Store.open(folder / "store.sqlite") as store:
        name = EventLog(store, RUN).decisions()["shortlist"].name
    words = {
        "type": "vote",
        "question": "shortlist",
        "decision": name,
        "approve": ids("cd"),
        "rank": ids("cd"),
        "reason": "calm",
    }
    return json.dumps(words | other)


def test_a_pass_for_files_is_given_for_a_token_and_lets_nobody_speak(server: MeetingServer) -> None:
    report = f"/runs/{RUN}/report/index.html"
    assert get(server, report)[0] == 403
    assert get(server, report, Cookie=f"nathlon-{server.address.port}=x")[0] == 403
    assert get(server, report, Cookie=f"nathlon-{server.address.port}={token(server)}")[0] == 403
    for wrong in (f"Bearer {'x' * 43}", token(server), "Bearer ", "Basic YQ=="):
        assert get(server, "/enter", Authorization=wrong)[0] == 403
    assert get(server, "/enter")[0] == 403
    status, headers, _ = get(server, "/enter", Authorization=f"Bearer {token(server)}")
    assert status == 204
    cookie, *facts = headers["Set-Cookie"].split("; ")
    assert {"HttpOnly", "SameSite=Strict", "Path=/runs/"} <= set(facts)
    assert token(server) not in cookie
    status, headers, text = get(server, report, Cookie=cookie)
    assert status == 200
    assert "The committee has not decided" in text or "Nobody to send yet" in text
    assert headers["Content-Security-Policy"] == "frame-ancestors 'self'"
    status, headers, text = get(server, f"/runs/{RUN}/replays/final.html", Cookie=cookie)
    assert (status, text) == (200, "<p>a race</p>")
    # Others may have written it: it has no part in the room.
    assert "sandbox allow-scripts" in headers["Content-Security-Policy"]
    assert "allow-same-origin" not in headers["Content-Security-Policy"]
    for path in ("store.sqlite", "races/secret.json", "replays/none.html", "replays/..%2Fstore.sqlite"):
        assert get(server, f"/runs/{RUN}/{path}", Cookie=cookie)[0] == 404, path
    for path in ("/runs", "/runs/", f"/runs/{RUN}", f"/runs/{RUN}/", f"/runs/{RUN}/watch", "/drive", "//"):
        assert get(server, path, Cookie=cookie)[0] == 404, path
    assert get(server, "/runs/no-such/report/index.html", Cookie=cookie)[0] == 404
    with dial(server) as connection:
        connection.send(cookie.partition("=")[2])
        assert closed(connection) == 4001


def test_files_outside_of_a_runs_folders_are_not_shown(tmp_path: Path) -> None:
    run = tmp_path / "run"
    (run / "report").mkdir(parents=True)
    for path in (tmp_path / "other.html", run / "own.html", run / "report" / "index.html"):
        path.write_text("x", "utf-8")
    (run / "report" / "link.html").symlink_to(tmp_path / "other.html")
    (run / "report" / "weights.safetensors").write_text("x", "utf-8")
    found = shown_file(run, ["report", "index.html"])
    assert found is not None
    assert found[0] == run / "report" / "index.html"
    for parts in (
        ["own.html"],
        ["report", "link.html"],
        ["report", "weights.safetensors"],
        ["report", "..", "own.html"],
        ["report", "%2e%2e", "own.html"],
        ["report", "..%2fown.html"],
        ["report", "a%00.html"],
        ["report", ""],
        ["report"],
        [],
    ):
        assert shown_file(run, parts) is None, parts


@pytest.fixture
def own_pass(server: MeetingServer) -> str:
    """The cookie with which Ann's browser gets files."""
    headers = get(server, "/enter", Authorization=f"Bearer {token(server)}")[1]
    return headers["Set-Cookie"].partition(";")[0]


def test_many_who_read_a_large_file_slowly_take_neither_memory_nor_the_page(
    server: MeetingServer, folder: Path, own_pass: str
) -> None:
    large = folder / "replays" / "large.mcap"
    with large.open("wb") as file:
        file.truncate(LARGE)
    before = resident()
    readers = [HTTPConnection("127.0.0.1", server.address.port, timeout=PATIENCE_S) for _ in range(6)]
    headers = {"Host": server.address.authority, "Cookie": own_pass}
    for reader in readers:
        reader.request("GET", f"/runs/{RUN}/replays/large.mcap", headers=headers)
    answers = [reader.getresponse() for reader in readers]
    assert {(one.status, one.getheader("Content-Length")) for one in answers} == {(200, str(LARGE))}
    assert all(one.read(1 << 20) == bytes(1 << 20) for one in answers)
    assert get(server, "/")[0] == 200
    assert resident() - before < LARGE / 2
    for reader in readers:
        reader.close()


def test_a_part_of_a_file_may_be_asked_for(server: MeetingServer, own_pass: str) -> None:
    path = f"/runs/{RUN}/replays/final.html"
    status, headers, text = get(server, path, Cookie=own_pass, Range="bytes=3-8")
    assert (status, text, headers["Content-Range"]) == (206, "a race", "bytes 3-8/13")
    assert "sandbox" in headers["Content-Security-Policy"]
    assert get(server, path, Cookie=own_pass, Range="bytes=99-")[0] == 416


def test_a_log_that_grows_is_sent_to_its_end(server: MeetingServer, folder: Path, own_pass: str) -> None:
    (folder / "policies.log").write_text("all is well\n", "utf-8")
    status, headers, text = get(server, f"/runs/{RUN}/policies.log", Cookie=own_pass)
    assert (status, headers["Content-Length"], text) == (200, None, "all is well\n")


def test_a_name_that_no_file_can_have_is_of_none(server: MeetingServer, own_pass: str) -> None:
    for name in ("x" * 300, "%F0%9F%8F%81" * 100, "%ff%fe", "x" * 4000):
        assert get(server, f"/runs/{RUN}/replays/{name}.html", Cookie=own_pass)[0] == 404
        assert get(server, f"/runs/{RUN}/watch/replays/{name}.mcap.html", Cookie=own_pass)[0] == 404
    assert get(server, f"/runs/{'x' * 4000}/report/index.html", Cookie=own_pass)[0] == 404


def test_a_frame_of_100_mb_ends_the_connection_and_nothing_else(server: MeetingServer) -> None:
    with enter(server) as connection:
        with suppress(ConnectionClosed):
            connection.send("x" * (100 << 20))
        assert closed(connection) in (1009, CUT)
    with enter(server):
        pass


def test_a_flood_of_frames_ends_the_connection_and_nothing_else(server: MeetingServer) -> None:
    with enter(server, "bob") as other, enter(server) as connection:
        with suppress(ConnectionClosed):
            for _ in range(10_000):
                connection.send('{"type": "look"}')
        assert closed(connection) == 1008
        other.send('{"type": "look", "run": null}')
        other.send(json.dumps({"type": "decide", "question": "shortlist", "decision": "none"}))
        assert "put anew" in hear(other, "refused")["why"]


@pytest.mark.parametrize(
    "nonsense",
    ["[]", "{", "[" * 60_000, '{"type": 1}', '{"type": "vote"}', '{"type": "look", "x": 1}', b"short"],
)
def test_what_is_no_message_ends_the_connection(server: MeetingServer, nonsense: str | bytes) -> None:
    assert len(nonsense) <= LARGEST_MESSAGE
    with enter(server) as connection:
        connection.send(nonsense)
        assert closed(connection) == 1008


def test_a_member_has_so_many_windows(server: MeetingServer) -> None:
    with enter(server) as a, enter(server), enter(server), enter(server), enter(server), enter(server):
        with enter(server), enter(server), dial(server) as one_more:
            one_more.send(token(server))
            assert closed(one_more) == 4002
        a.send('{"type": "look"}')
        assert hear(a, "state")["run"] == RUN


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"reason": " "}, "reason is empty"),
        ({"reason": "two\nlines"}, "cannot be printed"),
        ({"approve": ["nobody"]}, "no candidate"),
        ({"approve": ids("d"), "rank": ids("cd")}, "rank puts cedar before an approved entrant"),
        ({"approve": ids("cc")}, "names an entrant twice"),
        ({"decision": "shortlist-0"}, "the question has been put anew"),
        ({"question": "selection"}, "the question has been put anew"),
    ],
)
def test_a_wrong_ballot_is_told_in_a_sentence(
    server: MeetingServer, folder: Path, other: dict[str, Any], said: str
) -> None:
    before = entries(folder)
    with enter(server) as connection:
        connection.send(vote(server, folder, **other))
        assert said in hear(connection, "refused")["why"]
    assert entries(folder) == before


def test_who_is_not_on_the_committee_reads_and_does_not_vote(folder: Path) -> None:
    with met(folder / "store.sqlite", members=("eve",)) as meeting, enter(meeting, "eve") as connection:
        connection.send(vote(meeting, folder))
        assert "'eve' is not on the committee" in hear(connection, "refused")["why"]
        question = {key: json.loads(vote(meeting, folder))[key] for key in ("question", "decision")}
        before = entries(folder)
        connection.send(json.dumps({"type": "decide", **question}))
        assert "'eve' is not on the committee" in hear(connection, "refused")["why"]
        connection.send(json.dumps({"type": "reopen", "reason": "I would like to", **question}))
        hear(connection, "refused")
        assert entries(folder) == before


def test_nothing_is_logged_that_opens_the_room(
    server: MeetingServer, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    caplog.set_level("INFO")
    with enter(server):
        get(server, "/enter", Authorization=f"Bearer {token(server)}")
    assert token(server) not in caplog.text + "".join(capfd.readouterr())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--host", "0.0.0.0"], "--host 0.0.0.0: is beyond this machine, expected --cert and --key too"),
        (["--host", "room.example"], "--host room.example: is beyond this machine"),
        (["--host", "::", "--cert", "x", "--key", "y"], "--host ::: no browser calls it so"),
        (["--cert", "x.pem"], "--cert, --key: expected both or neither"),
        (["--cert", "x.pem", "--key", "y.pem"], "--cert x.pem, --key y.pem: cannot be used (No such file"),
    ],
)
def test_beyond_this_machine_the_room_needs_tls(
    folder: Path, arguments: list[str], said: str, tmp_path: Path
) -> None:
    refused(nathlon("serve", folder / "store.sqlite", *arguments, cwd=tmp_path), said)


def test_a_store_without_a_run_or_members_is_refused(tmp_path: Path) -> None:
    refused(nathlon("serve", "none.sqlite", cwd=tmp_path), "none.sqlite: no such store")
    with Store(tmp_path / "store.sqlite") as store:
        refused(nathlon("serve", "store.sqlite", cwd=tmp_path), "store.sqlite: holds no run")
        store.begin_run(RUN, {})
        refused(nathlon("serve", "store.sqlite", cwd=tmp_path), "nobody has been asked to vote", "--member")


def test_the_command_prints_an_address_for_every_member_and_stops_at_ctrl_c(folder: Path) -> None:
    command = [sys.executable, "-m", "nathlon.cli", "serve", str(folder / "store.sqlite"), "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            printed = "".join(iter(process.stdout.readline, "}\n")) + "}"
            urls: dict[str, str] = json.loads(printed)["members"]
            assert list(urls) == list(PEOPLE.members)
            origin, _, given = urls["cy"].partition("/#")
            with connect(f"ws{origin.removeprefix('http')}/room", origin=Origin(origin)) as connection:
                connection.send(given)
                assert hear(connection, "welcome")["you"] == "cy"
                process.send_signal(signal.SIGINT)
                assert closed(connection) in (1012, CUT)
            told = process.communicate(timeout=PATIENCE_S)[1]
        finally:
            process.kill()
    assert process.returncode == 0, told
    assert told.splitlines()[-1] == "Stopped."
    assert not any(url.partition("#")[2] in told for url in urls.values())


def test_with_tls_the_addresses_and_the_origin_are_its_own(tmp_path: Path) -> None:
    cert, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    made = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1"]
    subject = ["-nodes", "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"]
    subprocess.run([*made, *subject, "-keyout", key, "-out", cert], check=True, capture_output=True)
    assert isinstance(tls_context(cert, key), ssl.SSLContext)
    with pytest.raises(InputError, match="expected a certificate and its key"):
        tls_context(key, cert)
    with Store(tmp_path / "store.sqlite") as store:
        store.begin_run(RUN, {})
        ask(EventLog(store, RUN), PEOPLE)
    with met(tmp_path / "store.sqlite", tls=tls_context(cert, key)) as meeting:
        assert meeting.url("ann").startswith(f"https://localhost:{meeting.address.port}/#")
        trusted = ssl.create_default_context(cafile=str(cert))
        with dial(meeting, ssl=trusted) as connection:
            connection.send(token(meeting))
            assert hear(connection, "welcome") == {"type": "welcome", "you": "ann"}
        plain = f"http://localhost:{meeting.address.port}"
        with pytest.raises(InvalidStatus), dial(meeting, ssl=trusted, origin=plain):
            pass


def test_browsers_leave_out_the_port_of_their_scheme() -> None:
    assert Address("room.example", 443, tls=True).origin == "https://room.example"
    assert Address("room.example", 443).origin == "http://room.example:443"
    assert Address("::1", 8080).authority == "[::1]:8080"
    assert all(is_loopback(host) for host in ("localhost", "127.0.0.1", "127.8.8.8", "::1"))
    assert not any(is_loopback(host) for host in ("0.0.0.0", "::", "10.0.0.1", "localhost.example"))

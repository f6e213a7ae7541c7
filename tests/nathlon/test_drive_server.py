"""The server of a test drive: whom it lets in, what it bears, and a page that goes away and comes back."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from email.message import Message
from html import unescape
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from nathlon.lab.drive.finalists import bundled_opponents
from nathlon.lab.drive.frames import COUNTDOWN, HEAD, PAUSED, RACING
from nathlon.lab.drive.room import Room
from nathlon.lab.drive.server import DriveServer
from nathlon.lab.drive.wheel import LARGEST_FRAME, MOST_FRAMES
from nathlon.policies.bundled import champion, generalist
from tests.support.command_line import nathlon, refused
from tests.support.drives import choice, inputs, served
from tests.support.sockets import CUT, PATIENCE_S, closed


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[DriveServer, Room]]:
    with served(tmp_path_factory.mktemp("drives")) as both:
        yield both


@pytest.fixture
def server(drive: tuple[DriveServer, Room]) -> DriveServer:
    return drive[0]


def get(server: DriveServer, path: str = "/", host: str | None = None) -> tuple[int, Message, str]:
    connection = HTTPConnection("127.0.0.1", server.port, timeout=PATIENCE_S)
    connection.request("GET", path, headers={"Host": host or f"127.0.0.1:{server.port}"})
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, answer.headers, text


def token(server: DriveServer) -> str:
    text = get(server)[2]
    found: dict[str, str] = json.loads(text.partition('id="session">')[2].partition("</script>")[0])
    assert found["address"] == f"ws://127.0.0.1:{server.port}"
    return found["token"]


@contextmanager
def dial(server: DriveServer, **other: Any) -> Iterator[ClientConnection]:
    facts = {"origin": f"http://127.0.0.1:{server.port}", "compression": None, "max_size": None} | other
    with connect(f"ws://127.0.0.1:{server.port}", **facts) as connection:
        yield connection


@contextmanager
def enter(server: DriveServer) -> Iterator[ClientConnection]:
    with dial(server) as connection:
        connection.send(token(server))
        assert hear(connection, "choices")["circuits"][0] == "lindenring"
        yield connection


def hear(connection: ClientConnection, kind: str) -> dict[str, Any]:
    """The next message of a kind; what comes before it is not looked at."""
    while True:
        message = connection.recv(timeout=PATIENCE_S)
        if isinstance(message, str) and json.loads(message)["type"] == kind:
            words: dict[str, Any] = json.loads(message)
            return words


def see(connection: ClientConnection) -> Any:
    """The head of the next frame."""
    while True:
        message = connection.recv(timeout=PATIENCE_S)
        if isinstance(message, bytes):
            return np.frombuffer(message, HEAD, 1)[0]


def say(connection: ClientConnection, **words: Any) -> None:
    connection.send(json.dumps(words))


def test_the_page_comes_with_a_policy_that_names_its_own_socket_alone(server: DriveServer) -> None:
    status, headers, text = get(server)
    assert status == 200
    assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    policy = unescape(text.partition('Policy" content="')[2].partition('">')[0])
    assert "default-src 'none'" in policy
    assert f"connect-src ws://127.0.0.1:{server.port};" in policy
    assert "unsafe" not in policy
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Cache-Control"] == "no-store"
    assert "http:" not in text.replace("http://www.w3.org/2000/svg", "")
    assert get(server, "/runs")[0] == 404


@pytest.mark.parametrize("host", ["localhost:{port}", "evil.example", "127.0.0.1", "127.0.0.1:1"])
def test_another_name_of_this_machine_gets_nothing(server: DriveServer, host: str) -> None:
    status, _, text = get(server, host=host.format(port=server.port))
    assert (status, text) == (403, "")


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://localhost:{port}", "https://127.0.0.1:{port}", "null", None]
)
def test_a_page_of_another_origin_is_not_let_in(server: DriveServer, origin: str | None) -> None:
    forged = origin and origin.format(port=server.port)
    with pytest.raises(InvalidStatus) as refusal, dial(server, origin=forged):
        pass
    assert refusal.value.response.status_code == 403


@pytest.mark.parametrize("wrong", ["", "x" * 43, b"x" * 43, '{"type": "race"}'])
def test_without_the_token_nothing_is_told(server: DriveServer, wrong: str | bytes) -> None:
    with dial(server) as connection:
        connection.send(wrong)
        assert closed(connection) == 4001


def test_a_frame_of_100_mb_ends_the_connection_and_nothing_else(server: DriveServer) -> None:
    with dial(server) as connection:
        connection.send(token(server))
        hear(connection, "choices")
        with suppress(ConnectionClosed):
            connection.send(bytes(100 << 20))
        assert closed(connection) in (1009, CUT)
    with enter(server):
        pass


def test_a_flood_of_frames_ends_the_connection_and_nothing_else(server: DriveServer) -> None:
    with enter(server) as connection:
        frame = inputs(1)
        with suppress(ConnectionClosed):
            for _ in range(10_000):
                connection.send(frame)
        assert closed(connection) == 1008
    with enter(server) as connection:
        for number in range(MOST_FRAMES // 2):
            connection.send(inputs(number))
        say(connection, type="nothing")
        assert "expected a page of this version" in hear(connection, "refused")["why"]


@pytest.mark.parametrize("nonsense", ["[]", "{", "[" * 4000, '{"type": 1, "type": 2}', b"short"])
def test_what_is_no_message_ends_the_connection(server: DriveServer, nonsense: str | bytes) -> None:
    assert len(nonsense) <= LARGEST_FRAME
    with enter(server) as connection:
        connection.send(nonsense)
        assert closed(connection) == 1008


def test_a_choice_that_cannot_be_is_told_in_a_sentence(server: DriveServer) -> None:
    with enter(server) as connection:
        say(connection, type="race", choice={"name": "Ada"})
        assert hear(connection, "refused")["why"].startswith("the choice: field circuit")
        unknown = choice().model_dump(mode="json") | {"circuit": "../../etc"}
        say(connection, type="race", choice=unknown)
        assert "circuit '../../etc' is unknown" in hear(connection, "refused")["why"]


def test_a_race_begins_when_the_page_is_ready(tmp_path: Path) -> None:
    """It would be over in a moment otherwise: a hundred seconds of it take one."""
    with served(tmp_path, pace=100.0) as (server, _), enter(server) as connection:
        say(connection, type="race", choice=choice().model_dump(mode="json"))
        hear(connection, "race")
        assert {(int(head["phase"]), int(head["tick"])) for head in (see(connection) for _ in range(20))} == {
            (COUNTDOWN, 0)
        }
        say(connection, type="pause")
        hear(connection, "paused")
        say(connection, type="ready")
        assert {int(see(connection)["phase"]) for _ in range(20)} == {COUNTDOWN}
        say(connection, type="go on")
        while see(connection)["phase"] != RACING:
            pass
        say(connection, type="leave")


def test_a_page_that_goes_away_finds_the_race_where_it_was(drive: tuple[DriveServer, Room]) -> None:
    server, room = drive
    with enter(server) as connection:
        say(connection, type="race", choice=choice().model_dump(mode="json"))
        assert [car["name"] for car in hear(connection, "race")["cars"]][1] == "2 human:Ada"
        say(connection, type="ready")
        while see(connection)["tick"] < 30:
            pass
        connection.send(inputs(1, throttle=1.0))
        while (frame := see(connection))["number"] != 1:
            pass
        tick = int(frame["tick"])
    with enter(server) as connection:
        assert hear(connection, "race")["choice"]["circuit"] == "lindenring"
        hear(connection, "paused")
        while (stands := see(connection))["phase"] != PAUSED:
            pass
        assert tick <= stands["tick"] < tick + 120
        assert see(connection)["tick"] == stands["tick"]
        # The page counts its inputs anew.
        connection.send(inputs(1, throttle=0.5))
        say(connection, type="go on")
        while see(connection)["tick"] < stands["tick"] + 10:
            pass
        say(connection, type="restart")
        hear(connection, "race")
        assert see(connection)["tick"] == 0
        say(connection, type="leave")
        say(connection, type="pause")
        hear(connection, "refused")
    assert room.heat is None
    assert room.kept == []


def test_a_second_window_takes_the_place_of_the_first(server: DriveServer) -> None:
    with enter(server) as first, enter(server) as second:
        assert closed(first) == 4000
        say(second, type="nothing")
        hear(second, "refused")


def test_a_port_that_is_taken_is_refused(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        done = nathlon("drive", "driver", "--no-open", "--port", str(port), "--out", "drives", cwd=tmp_path)
    refused(done, f"--port: {port} is taken", "expected a free one")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["no-such.safetensors"], "no-such.safetensors: no such file, expected a policy"),
        (["driver:pace=9"], "pace is 9.0"),
        (["driver", "--circuit", "nowhere"], "circuit 'nowhere' is unknown"),
        (["driver", "--car", "bus"], "car 'bus' is unknown"),
        (["driver", "--run", "runs/demo"], "expected either entrants or a run"),
        (["--run", "runs/none"], "runs/none"),
        (["human:nobody.json"], "human:nobody.json: no such file, expected the inputs of a person"),
    ],
)
def test_what_cannot_be_driven_is_refused(arguments: list[str], said: str, tmp_path: Path) -> None:
    refused(nathlon("drive", *arguments, "--no-open", cwd=tmp_path), said)


def test_the_generalist_alone_of_those_bundled_races_on_any_circuit() -> None:
    opponents = bundled_opponents()
    [only] = [one for one in opponents if one.drives("my/circuit.toml", "coupe")]
    assert Path(only.source) == generalist()
    at_home = [Path(one.source) for one in opponents if one.drives("lindenring", "gt3")]
    assert at_home == [champion("lindenring", "gt3"), generalist()]

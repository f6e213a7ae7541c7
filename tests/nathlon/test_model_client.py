"""The client of a language model: whatever the server does ends in a sentence, in time."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Iterable, Iterator

import pytest

from nathlon.lab.llm import chat
from nathlon.lab.llm.chat import KEY, MODEL, URL, Endpoint
from nathlon.sim.errors import InputError
from tests.support.scripted_model import answer, raw_model, saying

KEPT = "k-123456"
OK = b"HTTP/1.1 200 OK\r\n"


def ask(url: str) -> str:
    return Endpoint(url, "small", KEPT).say([{"role": "user", "content": "Well?"}])


def refusal(*answers: Iterable[bytes]) -> tuple[str, list[bytes]]:
    """What is said of a server that answers so, and what it has heard."""
    with raw_model(*answers) as (url, heard), pytest.raises(InputError, match="cannot be asked") as caught:
        ask(url)
    said = str(caught.value)
    assert said.startswith(f"{url}: the model 'small' cannot be asked: ")
    assert said.isprintable()
    assert KEPT not in said
    return said.partition("asked: ")[2], heard


@pytest.mark.parametrize(
    "answered",
    [
        [],
        [b"\x00\xff garbage \r\n\r\n"],
        [OK + b"Transfer-Encoding: chunked\r\n\r\nffff\r\nabc"],
        [OK + b"Content-Length: 1000\r\n\r\n{"],
        [OK, *[b"X-Same: again\r\n" * 1000] * 20],
        [OK + b"X-Long: " + b"a" * 300_000 + b"\r\n\r\n"],
        [b"HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: 3\r\n\r\nabc"],
        answer(200, "<html>"),
        answer(200, b"\xff\xfe"),
        answer(200, '{"choices": []}'),
        answer(200, "[" * 100_000),
    ],
)
def test_what_is_no_answer(answered: list[bytes]) -> None:
    refusal(answered)


def test_more_than_fits() -> None:
    said, _ = refusal([OK + b"\r\n", *[b" " * (1 << 16)] * 100])
    assert said == "it answers with more than 1 MiB"


def test_a_byte_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chat, "PATIENCE_S", 0.3)

    def bytes_of(head: bytes) -> Iterator[bytes]:
        yield head
        for _ in range(1000):
            time.sleep(0.02)
            yield b"a"

    for head in (OK + b"Content-Length: 1000\r\n\r\n", OK + b"X-Slow: "):
        said, _ = refusal(bytes_of(head))
        assert said == "no whole answer in 0.3 s"


def test_a_redirect_is_not_followed() -> None:
    with raw_model() as (elsewhere, heard_there):
        said, _ = refusal(answer(307, "", Location=elsewhere))
        assert f"redirects are not followed: {elsewhere}" in said
        assert heard_there == []


def test_a_server_that_is_busy_is_asked_again() -> None:
    busy = answer(429, "", Retry_After="0")
    past = answer(503, "", Retry_After="Fri, 31 Dec 1999 23:59:59 GMT")
    with raw_model(busy, past, answer(200, saying("Yes."))) as (url, heard):
        assert ask(url) == "Yes."
    assert len(heard) == 3
    said, heard = refusal(*[busy] * (chat.TRIES + 1))
    assert said == "it answers 429 Told"
    assert len(heard) == chat.TRIES


def test_it_does_not_wait_for_what_comes_too_late() -> None:
    said, heard = refusal(answer(429, '{"error": "Quota used up."}', Retry_After="86400"))
    assert said == "it answers 429 Told: Quota used up."
    assert len(heard) == 1


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ({"error": {"message": "no such model"}}, "no such model"),
        ({"detail": "no such model"}, "no such model"),
        ({"error": {"message": "\x1b[31mred"}}, r"\x1b[31mred"),
        ({"error": {"message": f"{KEPT} is no key"}}, "*** is no key"),
        ({"error": {"message": "x" * 5000}}, "x" * 300),
        ({"error": 7}, '{"error": 7}'),
    ],
)
def test_the_servers_reason_is_told(body: object, reason: str) -> None:
    said, heard = refusal(answer(400, json.dumps(body)))
    assert said == f"it answers 400 Told: {reason}"
    assert len(heard) == 1, "it will not say otherwise"


def test_what_a_model_may_refuse_is_not_asked_for() -> None:
    with raw_model(answer(200, saying("Yes."))) as (url, heard):
        ask(url)
    head, _, body = heard[0].partition(b"{")
    assert set(json.loads(b"{" + body)) == {"model", "messages"}
    assert f"authorization: Bearer {KEPT}".encode().lower() in head.lower()


def test_in_a_notebook() -> None:
    async def cell(url: str) -> str:
        return ask(url)

    with raw_model(answer(200, saying("Yes."))) as (url, _):
        assert asyncio.run(cell(url)) == "Yes."


@pytest.mark.parametrize(
    "url",
    [
        "",
        "localhost:8000/v1",
        "file:///etc/passwd",
        "http://",
        "http://:80/v1",
        "http://[::1",
        "http://a:99999/v1",
        "http://a b/v1",
        "http://a/\n/v1",
        "http://xn--/v1",
    ],
)
def test_an_address_that_is_none(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(URL, url)
    with pytest.raises(InputError, match=r"^NATHLON_MODEL_URL is .*, expected the address of a model"):
        Endpoint.from_environment()


@pytest.mark.parametrize("key", ["two words", "line\n", "é"])
def test_a_key_that_is_none(key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in ((URL, "http://localhost/v1"), (MODEL, "small"), (KEY, key)):
        monkeypatch.setenv(name, value)
    with pytest.raises(InputError, match=r"^NATHLON_MODEL_KEY has ") as caught:
        Endpoint.from_environment()
    assert key not in str(caught.value)


def test_a_judge_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (chat.JUDGE, chat.JUDGE_URL, chat.JUDGE_KEY):
        monkeypatch.delenv(name, raising=False)
    for name, value in ((URL, "http://a/v1"), (MODEL, "small"), (KEY, KEPT)):
        monkeypatch.setenv(name, value)
    assert Endpoint.judge_from_environment() == Endpoint.from_environment()
    monkeypatch.setenv(chat.JUDGE, "seer")
    assert Endpoint.judge_from_environment() == ("http://a/v1", "seer", KEPT)
    monkeypatch.setenv(chat.JUDGE_URL, "http://b/v1")
    assert Endpoint.judge_from_environment() == ("http://b/v1", "seer", ""), "a key stays at its address"

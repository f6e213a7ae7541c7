"""A language model behind the chat interface of OpenAI, which many servers speak, also on this machine."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import NamedTuple, Required, TypedDict

import anyio
import anyio.from_thread
import httpx
from pydantic import BaseModel, Field, ValidationError

from nathlon.lab.llm.refusals import explanation, pause_s
from nathlon.sim.errors import InputError

URL, MODEL, KEY = "NATHLON_MODEL_URL", "NATHLON_MODEL", "NATHLON_MODEL_KEY"
"""Variables of the environment: the interface's address up to `/v1`, the model's name, and a key if any."""
JUDGE_URL, JUDGE, JUDGE_KEY = "NATHLON_JUDGE_URL", "NATHLON_JUDGE", "NATHLON_JUDGE_KEY"
"""The same for a judge that is another model; without an address of its own, at the same one."""
PATIENCE_S = 120.0
"""For an answer in all, with every try."""
TRIES = 5
MOST_BYTES = 1 << 20
GREETING = "Answer with the word yes."


class MessagePart(TypedDict, total=False):
    """A piece of a message: a text, or a picture by its address."""

    type: Required[str]
    text: str
    image_url: dict[str, str]


class Message(TypedDict):
    """One of a conversation."""

    role: str
    content: str | list[MessagePart]


class _Said(BaseModel):
    content: str


class _Choice(BaseModel):
    message: _Said


class _Answer(BaseModel):
    choices: list[_Choice] = Field(min_length=1)


class Endpoint(NamedTuple):
    """Where a model is.

    Attributes:
        url: of the interface, http or https.
        model: its name there.
        key: sent with each request; empty for none.
    """

    url: str
    model: str
    key: str

    @classmethod
    def from_environment(cls) -> Endpoint:
        """The one that the environment names.

        Raises:
            InputError: if it names none.
        """
        return cls(_address(URL), _model(MODEL), _key(KEY))

    @classmethod
    def judge_from_environment(cls) -> Endpoint:
        """The one that the environment names as the judge, or else the same as for all else.

        Raises:
            InputError: if it names none.
        """
        model = _model(JUDGE if os.environ.get(JUDGE) else MODEL)
        # A key goes to the address that it was given for, and no other.
        url, key = (JUDGE_URL, JUDGE_KEY) if os.environ.get(JUDGE_URL) else (URL, KEY)
        return cls(_address(url), model, _key(key))

    def check(self) -> None:
        """Have it say a word, so that a wrong address, name or key shows before the work.

        Raises:
            InputError: if it cannot be asked.
        """
        self.say([{"role": "user", "content": GREETING}])

    def say(self, messages: Sequence[Message]) -> str:
        """The model's answer to a conversation, within PATIENCE_S.

        A server that is busy is asked again, when it says so.

        Raises:
            InputError: if it cannot be reached, does not answer in time, or answers with something else.
        """
        try:
            # In a thread, as a notebook has a loop of its own.
            with anyio.from_thread.start_blocking_portal() as portal:
                answer = portal.call(self._ask, messages)
            return _Answer.model_validate_json(answer).choices[0].message.content
        except TimeoutError:
            raise self._failed(f"no whole answer in {PATIENCE_S:g} s") from None
        except ValidationError:
            raise self._failed("it answers otherwise than the chat interface does") from None
        except (httpx.HTTPError, httpx.InvalidURL, OSError, ImportError, ValueError) as error:
            # ImportError: of what a proxy that the environment names would need.
            raise self._failed(str(error) or type(error).__name__) from None

    async def _ask(self, messages: Sequence[Message]) -> bytes:
        content = {"model": self.model, "messages": list(messages)}
        # What is compressed may be a thousand times as large as it looks.
        headers = {"Accept-Encoding": "identity"}
        if self.key:
            headers["Authorization"] = f"Bearer {self.key}"
        url = httpx.URL(self.url)
        url = url.copy_with(path=f"{url.path.rstrip('/')}/chat/completions")
        with anyio.fail_after(PATIENCE_S):
            # One that a server is about to close must not be used for the next try.
            fresh = httpx.Limits(max_keepalive_connections=0)
            async with httpx.AsyncClient(headers=headers, timeout=None, limits=fresh) as client:
                for attempt in range(TRIES):
                    async with client.stream("POST", url, json=content) as response:
                        body = await self._read(response)
                    wait_s = pause_s(response, attempt)
                    if wait_s is None or attempt == TRIES - 1 or wait_s > _left_s():
                        break
                    await anyio.sleep(wait_s)
        if response.is_success:
            return body
        raise self._failed(explanation(response, body, self.key))

    async def _read(self, response: httpx.Response) -> bytes:
        body = b""
        async for part in response.aiter_raw():
            body += part
            if len(body) > MOST_BYTES:
                raise self._failed(f"it answers with more than {MOST_BYTES >> 20} MiB")
        return body

    def _failed(self, why: str) -> InputError:
        place = self.url.partition("?")[0]
        return InputError(f"{place}: the model {self.model!r} cannot be asked: {why}")


def _left_s() -> float:
    return anyio.current_effective_deadline() - anyio.current_time()


def _address(name: str) -> str:
    given = os.environ.get(name, "")
    try:
        url = httpx.URL(given)
        is_one = url.scheme in ("http", "https") and bool(url.host) and 0 < (url.port or 1) < 1 << 16
    except (httpx.InvalidURL, ValueError):
        is_one = False
    if not is_one or not given.isprintable() or " " in given:
        raise InputError(f"{name} is {given!r}, expected the address of a model, http://localhost:8000/v1")
    if url.userinfo:
        raise InputError(f"{name} has a name or password in it, expected the key in a variable of its own")
    return given.rstrip("/")


def _model(name: str) -> str:
    given = os.environ.get(name, "")
    if not given:
        raise InputError(f"{name} is not set, expected the name of a model")
    return given


def _key(name: str) -> str:
    given = os.environ.get(name, "")
    if not all("!" <= letter <= "~" for letter in given):
        raise InputError(f"{name} has spaces, line ends or letters beyond ASCII, expected a key without")
    return given

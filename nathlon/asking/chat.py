"""A language model behind the chat interface of OpenAI, which many servers speak, also on this machine."""

from __future__ import annotations

import json
import os
import urllib.error
import urllib.request
from collections.abc import Sequence
from typing import NamedTuple, Required, TypedDict

from pydantic import BaseModel, Field, ValidationError

from nathlon.sim.errors import InputError

URL, MODEL, KEY = "NATHLON_MODEL_URL", "NATHLON_MODEL", "NATHLON_MODEL_KEY"
"""Variables of the environment: the interface's address up to `/v1`, the model's name, and a key if any."""
PATIENCE_S = 120.0
MOST_BYTES = 1 << 20


class Part(TypedDict, total=False):
    """A piece of a message: a text, or a picture by its address."""

    type: Required[str]
    text: str
    image_url: dict[str, str]


class Message(TypedDict):
    """One of a conversation."""

    role: str
    content: str | list[Part]


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
        url, model = os.environ.get(URL, ""), os.environ.get(MODEL, "")
        if not url.startswith(("http://", "https://")):
            raise InputError(f"{URL} is {url!r}, expected the address of a model, http://localhost:8000/v1")
        if not model:
            raise InputError(f"{MODEL} is not set, expected the name of a model")
        return cls(url.rstrip("/"), model, os.environ.get(KEY, ""))

    def say(self, messages: Sequence[Message]) -> str:
        """The model's answer to a conversation.

        Raises:
            InputError: if it cannot be reached, or answers with something else.
        """
        content = json.dumps({"model": self.model, "messages": list(messages), "temperature": 0}).encode()
        headers = {"Content-Type": "application/json"}
        if self.key:
            headers["Authorization"] = f"Bearer {self.key}"
        request = urllib.request.Request(f"{self.url}/chat/completions", content, headers)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE_S) as response:
                answer = response.read(MOST_BYTES)
            return _Answer.model_validate_json(answer).choices[0].message.content
        except (OSError, urllib.error.URLError) as error:
            raise InputError(f"{self.url}: the model cannot be asked: {error}") from None
        except ValidationError:
            raise InputError(f"{self.url}: answers otherwise than the chat interface does") from None

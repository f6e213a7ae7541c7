"""What a language model was asked and answered, kept so that it can be said again without the model."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict

from nathlon.lab.llm.chat import Endpoint, Message, MessagePart
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.validation import read_json
from nathlon.sim.whole_file import whole_file

LARGEST_MIB = 4


class Exchange(BaseModel):
    """A question and its answer.

    Attributes:
        model: that was asked.
        asked: SHA-256 of the messages.
        messages: pictures are given by the SHA-256 of their files.
        reply: what it answered.
    """

    model_config = ConfigDict(extra="forbid")

    model: str
    asked: str
    messages: list[dict[str, object]]
    reply: str


class Transcripts(NamedTuple):
    """Exchanges in a folder, one file each.

    Attributes:
        folder: where they are kept.
        endpoint: the model; None if there is none.
        earlier: folder of another run, whose answers are given again instead of a model's.
    """

    folder: Path
    endpoint: Endpoint | None
    earlier: Path | None = None

    def ask(self, label: str, messages: Sequence[Message]) -> str:
        """The answer to a conversation: that which was given before, or else the model's.

        Args:
            label: of the question, the name of its file; the same in a run that is repeated.
            messages: the conversation.

        Raises:
            InputError: if there is neither an answer nor a model, it cannot be asked, or a file is wrong.
        """
        kept, asked = self.folder / f"{label}.json", _digest(messages)
        if kept.exists() and (found := _read(kept)).asked == asked:
            return found.reply
        if self.earlier is not None:
            reply, model = self._again(label)
        elif self.endpoint is None:
            raise InputError(f"{label}: there is no model to ask, expected one or the transcripts of a run")
        else:
            reply, model = self.endpoint.say(messages), self.endpoint.model
        exchange = Exchange(
            model=model, asked=asked, messages=[_without_pictures(one) for one in messages], reply=reply
        )
        self.folder.mkdir(parents=True, exist_ok=True)
        with whole_file(kept) as partial:
            partial.write_text(
                json.dumps(exchange.model_dump(), indent=1, ensure_ascii=False) + "\n", "utf-8"
            )
        return reply

    def _again(self, label: str) -> tuple[str, str]:
        assert self.earlier is not None, "it was given"
        path = self.earlier / f"{label}.json"
        if not path.exists():
            raise InputError(f"{path}: is missing, expected the transcripts of a run that asked the same")
        found = _read(path)
        return found.reply, found.model


def _read(path: Path) -> Exchange:
    return read_json(read_text(path, "transcript", LARGEST_MIB), Exchange, path)


def _digest(messages: Sequence[Message]) -> str:
    return hashlib.sha256(json.dumps(list(messages), sort_keys=True).encode()).hexdigest()


def _without_pictures(message: Message) -> dict[str, object]:
    content = message["content"]
    if isinstance(content, str):
        return {"role": message["role"], "content": content}
    return {"role": message["role"], "content": [_named(part) for part in content]}


def _named(part: MessagePart) -> dict[str, object]:
    if "image_url" not in part:
        return dict(part)
    _, _, encoded = part["image_url"]["url"].partition("base64,")
    return {"type": part["type"], "sha256": hashlib.sha256(base64.b64decode(encoded)).hexdigest()}


def picture(png: bytes) -> MessagePart:
    """A picture as a part of a message.

    Args:
        png: its file.
    """
    address = f"data:image/png;base64,{base64.b64encode(png).decode()}"
    return {"type": "image_url", "image_url": {"url": address}}

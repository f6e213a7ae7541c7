"""JSON that means one thing: what two readers might understand in two ways is refused."""

from __future__ import annotations

import json
from typing import Any


def parse_json(text: str) -> Any:
    """The values of a JSON text.

    Raises:
        ValueError: if it is no JSON, is nested too deeply, or an object has a key twice.
    """
    try:
        return json.loads(text, object_pairs_hook=_object)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"key {key!r} stands twice in an object")
        found[key] = value
    return found

"""What a server says that does not answer: when to ask again, and why."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import Any

import httpx

LONGEST = 300
"""Characters of a reason."""
BUSY = (408, 409, 425, 429)
"""Codes that pass, beside those from 500 on."""


def pause_s(response: httpx.Response, attempt: int) -> float | None:
    """Seconds after which to ask again, as `Retry-After` says or else 1, 2, 4, ..; None if that is no use."""
    if response.status_code not in BUSY and response.status_code < 500:
        return None
    given = response.headers.get("Retry-After", "")
    if given.strip().isdecimal():
        return float(given)
    try:
        at = parsedate_to_datetime(given)
    except ValueError:
        return float(2**attempt)
    return max((at.replace(tzinfo=at.tzinfo or UTC) - datetime.now(UTC)).total_seconds(), 0.0)


def explanation(response: httpx.Response, body: bytes, key: str) -> str:
    """Why a server refuses, shortened and without the key, whatever else it quotes."""
    said = f"it answers {response.status_code} {response.reason_phrase}".rstrip()
    if response.has_redirect_location:
        return f"{said}, and redirects are not followed: {response.headers['Location'][:LONGEST]}"
    why = _reason(body)
    why = why.replace(key, "***") if key else why
    return f"{said}: {why[:LONGEST]}" if why else said


def _reason(body: bytes) -> str:
    """The sentence in `{"error": {"message": ..}}` and its relatives, or else the text as it is."""
    text = " ".join(body.decode("utf-8", "replace").split())
    try:
        found: Any = json.loads(body)
    except (ValueError, RecursionError):
        return text
    for _ in range(2):
        if isinstance(found, dict):
            found = next((found[name] for name in ("error", "message", "detail") if name in found), found)
    return found if isinstance(found, str) else text

"""A night as messages: plain text, and what Slack and Teams take."""

from __future__ import annotations

from typing import Any

from nathlon.lab.sinks.bulletin import Bulletin
from nathlon.reports.gate import escaped
from nathlon.results.standing import Ranked

HEADER, BLOCK = 150, 2900
"""Letters that Slack takes in a heading and in a section, less than its limits."""
ROWS = 12
"""Of the ranking, in a message."""
ALTERNATIVE = "Ranking with intervals"


def title(bulletin: Bulletin) -> str:
    """The verdict with the night before it."""
    return f"{bulletin.night}: {bulletin.headline}" if bulletin.night else bulletin.headline


def text(bulletin: Bulletin) -> str:
    """The verdict, the best of the ranking and the link, as plain text."""
    parts = [bulletin.headline, *bulletin.sentences]
    if bulletin.ranking:
        parts.append("\n".join(map(_row, bulletin.ranking[:ROWS])))
    if bulletin.report:
        parts.append(f"Report: {bulletin.report}")
    parts.append(f"Exit code {bulletin.code}: {bulletin.reason}")
    return "\n\n".join(parts) + "\n"


def slack(bulletin: Bulletin) -> dict[str, Any]:
    """A message of Block Kit: https://docs.slack.dev/reference/block-kit/blocks."""
    heading = _cut(title(bulletin), HEADER)
    blocks: list[dict[str, Any]] = [{"type": "header", "text": {"type": "plain_text", "text": heading}}]
    if said := " ".join(bulletin.sentences) or bulletin.reason:
        blocks.append({"type": "section", "text": {"type": "plain_text", "text": _cut(said, BLOCK)}})
    if bulletin.picture:
        blocks.append({"type": "image", "image_url": bulletin.picture, "alt_text": ALTERNATIVE})
    if bulletin.report:
        button = {"type": "button", "text": {"type": "plain_text", "text": "Report"}, "url": bulletin.report}
        blocks.append({"type": "actions", "elements": [button]})
    return {"text": heading, "blocks": blocks}


def teams(bulletin: Bulletin) -> dict[str, Any]:
    """A message with an adaptive card: https://adaptivecards.io/explorer."""
    said = " ".join(bulletin.sentences) or bulletin.reason
    body: list[dict[str, Any]] = [
        {
            "type": "TextBlock",
            "text": escaped(title(bulletin)),
            "size": "Large",
            "weight": "Bolder",
            "wrap": True,
        },
        {"type": "TextBlock", "text": escaped(said), "wrap": True},
    ]
    if bulletin.picture:
        body.append({"type": "Image", "url": bulletin.picture, "altText": ALTERNATIVE})
    card: dict[str, Any] = {
        "$schema": "http://adaptivecards.io/schemas/adaptive-card.json",
        "type": "AdaptiveCard",
        "version": "1.4",
        "body": body,
    }
    if bulletin.report:
        card["actions"] = [{"type": "Action.OpenUrl", "title": "Report", "url": bulletin.report}]
    return {
        "type": "message",
        "attachments": [{"contentType": "application/vnd.microsoft.card.adaptive", "content": card}],
    }


def _row(row: Ranked) -> str:
    points = "–" if row.points_per_race is None else f"{row.points_per_race:.2f}"
    if row.points_low is not None and row.points_high is not None:
        points += f" ({row.points_low:.2f} to {row.points_high:.2f})"
    return f"{row.written_rank}: {row.name}  {points}"


def _cut(said: str, most: int) -> str:
    return said if len(said) <= most else f"{said[: most - 1]}…"

"""`nathlon coach`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nathlon.commands.options import AsJson, Out, Recording
from nathlon.commands.selection import at_work
from nathlon.terminal import print_json, say, warn


def coach(
    recording: Recording,
    car: Annotated[str, typer.Option(help="Start number or name of the car to coach.")],
    against: Annotated[
        str, typer.Option(help="Lap to compare with: champion, limit, or RACE.mcap.")
    ] = "champion",
    out: Out = Path("runs/coach"),
    phrase: Annotated[
        bool,
        typer.Option(
            "--phrase", help="Phrase the advice with a language model: NATHLON_MODEL_URL, NATHLON_MODEL."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Say where a recorded car lost time and why, and what is faster there.

    Every advice has been driven again with the edit and gains; what does not is not given.
    """
    with at_work("Nothing was written."):
        import nathlon

        result = nathlon.coach(
            recording, car=car, against=against, out=out, phrase=phrase, progress=not as_json
        )
    if result.refused:
        warn(f"What the model said is refused, it is not in the facts: {'; '.join(result.refused)}")
    if result.unasked:
        warn(f"The words are the coach's own: {result.unasked}")
    if as_json:
        print_json(result.facts.model_dump(mode="json"))
        return
    for line in result.text.splitlines():
        say(line)
    say("")
    say(f"Facts: {result.facts_file}")
    say(f"Page:  {result.page}")

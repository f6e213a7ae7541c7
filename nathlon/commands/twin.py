"""`nathlon twin`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from nathlon.commands.incident import named_policy
from nathlon.commands.options import AsJson, Out, Recording
from nathlon.commands.selection import at_work
from nathlon.terminal import print_json, say


def twin(
    recording: Recording,
    car: Annotated[str, typer.Option(help="Start number or name of the car to compare.")],
    other: Annotated[
        Path | None,
        typer.Argument(help="Recording of another race from the same start, instead of --policy."),
    ] = None,
    policy: Annotated[
        str | None,
        typer.Option(help="Driver of the car in the twin: checkpoint, composite, driver or plugin."),
    ] = None,
    at_s: Annotated[
        float, typer.Option("--at", help="Time at which it takes over, s since the start.")
    ] = 0.0,
    out: Out = Path("runs/twin"),
    store: Annotated[
        str | None,
        typer.Option(help="Store that holds the race; the one beside the recording by default."),
    ] = None,
    entrant: Annotated[
        list[str] | None,
        typer.Option(help="NAME=FILE: a policy of the race that no store knows; may be repeated."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run a recorded race again with another policy in a car's place, and show both side by side.

    The policy takes over at --at without memory of what was before, and says from then on when the car stops;
    until then both races are the same.
    """
    with at_work("Nothing was written."):
        import nathlon

        result = nathlon.twin(
            recording,
            other,
            car=car,
            policy=policy,
            at_s=at_s,
            out=out,
            store=store,
            entrants=dict(named_policy(each, "--entrant") for each in entrant or ()),
            progress=not as_json,
        )
    if as_json:
        paths = {name: getattr(result, name) for name in ("page", "replay", "original", "twin")}
        print_json({**paths, "parted_s": result.parted_s, "outcomes": result.outcomes.to_dicts()})
        return
    for line in repr(result).splitlines():
        say(line)
    say(f"Rerun: {shlex.join(['rerun', str(result.replay)])}")

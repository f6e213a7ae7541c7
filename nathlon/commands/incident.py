"""`nathlon incident`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nathlon.commands.options import AsJson, Recording
from nathlon.results.words import percent
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import check_output
from nathlon.terminal import say, tell


def incident(
    recording: Recording,
    at_s: Annotated[float, typer.Option("--at", help="Time of the incident, s since the start, within 2 s.")],
    car: Annotated[str, typer.Option(help="Start number or name of the car to be tested.")],
    name: Annotated[str, typer.Option(help="Name of the test.")],
    out: Annotated[Path, typer.Option(help="Folder of the incidents.")] = Path("incidents"),
    store: Annotated[
        str | None,
        typer.Option(help="Store that knows the policies; the one beside the recording by default."),
    ] = None,
    policy: Annotated[
        list[str] | None,
        typer.Option(help="NAME=FILE: a policy that the store does not know; may be repeated."),
    ] = None,
    before_s: Annotated[
        float, typer.Option("--before", min=0.5, max=30, help="Time at which it begins, s.")
    ] = 4.0,
    after_s: Annotated[float, typer.Option("--after", min=0.5, max=60, help="Length of the test, s.")] = 6.0,
    runs: Annotated[
        int, typer.Option(min=1, max=1000, help="Runs of an entrant, each slightly different.")
    ] = 16,
    as_json: AsJson = False,
) -> None:
    """Make an incident a test: the same cars some seconds before it, which every later night runs.

    What counts as passed stands in the file that is written and may be changed there.
    """
    from nathlon.arena.recording import read_recording
    from nathlon.reports.cars import car_index
    from nathlon.selection.incident.drivers import sources_of
    from nathlon.selection.incident.folder import add_incident
    from nathlon.selection.incident.freeze import freeze

    check_output(out)
    log = read_recording(recording)
    beside = recording.resolve().parent.parent / "store.sqlite"
    known = store or (str(beside) if beside.exists() else None)
    frozen = freeze(log, at_s, car_index(log, car, recording), _file_name(name), before_s, after_s, runs)
    path = add_incident(
        out, frozen, sources_of(log, known, dict(named_policy(each, "--policy") for each in policy or ()))
    )
    passed, measure = frozen.skill.passed, frozen.skill.measure
    assert passed is not None, "an incident is passed or failed"
    facts = {"test": path, "happened": frozen.happened.text, "begins": f"{before_s:g} s before"}
    tell(
        facts | {"passed": f"{measure} at most {passed.at_most:g} in {percent(passed.share)} of {runs} runs"},
        as_json,
    )
    if not as_json:
        say(f"Every night runs it with [battery] incidents = {str(out)!r} in its configuration.")


def _file_name(name: str) -> str:
    if not name or any(letter in name for letter in '/\\:="') or name.startswith("."):
        raise InputError(f"--name is {name!r}, expected one that a file may have")
    return name


def named_policy(text: str, option: str) -> tuple[str, str]:
    """Name and source of a policy that an option gives as NAME=FILE."""
    name, given, file = text.rpartition("=")
    if not given or not file:
        raise InputError(f"{option} is {text!r}, expected NAME=FILE")
    return name, file

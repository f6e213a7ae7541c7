"""`nathlon drive`."""

from __future__ import annotations

import asyncio
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from nathlon.commands.options import AsJson, Port
from nathlon.policies.sources.finding import find_sources
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from nathlon.terminal import tell, warn

if TYPE_CHECKING:
    from nathlon.lab.drive.difficulty import Difficulty
    from nathlon.lab.drive.server import DriveServer


def drive(
    entrants: Annotated[
        list[str] | None,
        typer.Argument(help="Opponents: checkpoints, folders of them, generalist, drivers, plugin:NAME."),
    ] = None,
    run: Annotated[
        Path | None, typer.Option("--run", help="Race the finalists of the run in this folder.")
    ] = None,
    blind: Annotated[
        bool,
        typer.Option("--blind", help="Drive as a member of the committee: finalists are shown as letters."),
    ] = False,
    driver: Annotated[
        str | None, typer.Option(help="Name of the driver, for --blind, as in the committee's configuration.")
    ] = None,
    store: Annotated[
        str | None, typer.Option(help="Store of the run, for --blind; the one in its folder by default.")
    ] = None,
    circuit: Annotated[str | None, typer.Option(help="Name or path of the circuit to offer first.")] = None,
    car: Annotated[str | None, typer.Option(help="Name or path of the car to offer first.")] = None,
    difficulty: Annotated[
        Literal["chosen", "beginner", "intermediate", "expert", "match"] | None,
        typer.Option(help="Difficulty to offer first; match: as fast as your own laps here."),
    ] = None,
    temper: Annotated[
        Literal["calm", "fair", "aggressive"] | None,
        typer.Option(help="Temper of built-in drivers to offer first."),
    ] = None,
    port: Port = 0,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the browser.")] = True,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the drives; by default runs/drive, or drives in the run's folder with --blind."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Race policies yourself in a browser on this machine, with keys, gamepad or wheel.

    Without entrants and --run you race the bundled champions and generalist. Every race is kept, with what
    you did. After it the coach's page opens, unless --no-open.
    """
    if entrants and run:
        raise InputError(f"--run {run}: expected either entrants or a run")
    if blind:
        fixed = {"circuit": circuit, "car": car, "out": out, "difficulty": difficulty, "temper": temper}
        for name, value in fixed.items():
            if value is not None:
                raise InputError(f"--{name} {value}: expected what the run has raced, with --blind")
        if run is None or driver is None:
            raise InputError("--blind: expected --run FOLDER and --driver NAME too")
    elif driver is not None or store is not None:
        raise InputError("--driver, --store: expected with --blind alone")
    sources = find_sources(entrants or [])
    need("uvicorn", "drive", "a test drive")
    from nathlon.lab.drive.blind import BlindTest
    from nathlon.lab.drive.choice import DriveOpponent, Offer
    from nathlon.lab.drive.coached import CoachAfterwards
    from nathlon.lab.drive.difficulty import CHOSEN, NOVICE
    from nathlon.lab.drive.finalists import bundled_opponents, finalists
    from nathlon.lab.drive.room import Room
    from nathlon.lab.drive.server import serve_drives
    from nathlon.selection.publish.output import OutputFolder

    test: BlindTest | None = None
    if blind and run and driver:
        test = BlindTest(run, store or run / "store.sqlite", driver)
        offer, output = test.offer, test.output
    else:
        opponents = DriveOpponent.all(dict.fromkeys(sources))
        offer = Offer.of(opponents or (finalists(run) if run else bundled_opponents()), circuit, car)
        # Whoever names nobody, and drives for the first time, is not sent against champions.
        unchosen: Difficulty = CHOSEN if opponents or run else NOVICE
        offer = offer._replace(difficulty=difficulty, temper=temper, unchosen=unchosen)
        output = OutputFolder(out or Path("runs/drive"))

    def on_open(server: DriveServer) -> None:
        tell({"page": server.url, "drives": output.root}, as_json)
        # Whoever reads it through a pipe waits for it.
        sys.stdout.flush()
        warn("Ctrl-C ends it.")
        if show:
            webbrowser.open(server.url)

    coached = CoachAfterwards(output.root / "coach") if show and test is None else None
    try:
        asyncio.run(serve_drives(lambda: Room(offer, output, blind=test, on_kept=coached), port, on_open))
    except KeyboardInterrupt:
        warn("Stopped.")

"""The command line: its commands are functions of `nathlon.commands`, loading what they need as they run."""

from __future__ import annotations

import logging
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import takewhile
from types import FrameType

from nathlon.commands.ablate import ablate
from nathlon.commands.battery import battery
from nathlon.commands.car import check_car, generate_car, tune_car
from nathlon.commands.coach import coach
from nathlon.commands.committee import committee
from nathlon.commands.drive import drive
from nathlon.commands.events import endurance, season, weekend
from nathlon.commands.export import export
from nathlon.commands.gate import gate
from nathlon.commands.groups import CommandGroup
from nathlon.commands.incident import incident
from nathlon.commands.league import league
from nathlon.commands.matrix import matrix
from nathlon.commands.nightly import init, nightly, status
from nathlon.commands.observation import observation
from nathlon.commands.pack import pack, verify
from nathlon.commands.pareto import pareto
from nathlon.commands.plan import plan
from nathlon.commands.racing import race
from nathlon.commands.recipes import recipes
from nathlon.commands.replay import replay
from nathlon.commands.reward import design_reward
from nathlon.commands.selection import demo, evaluate, report
from nathlon.commands.serve import serve
from nathlon.commands.stints import stints
from nathlon.commands.store import clean_store, copy_store
from nathlon.commands.track import generate_track, import_track, limit_track, show_track
from nathlon.commands.training import polish, train
from nathlon.commands.twin import twin
from nathlon.commands.watch import watch
from nathlon.commands.worker import worker
from nathlon.commands.world import check_world, list_worlds
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable
from nathlon.terminal import print_json, warn
from nathlon.terminal.faults import FAULT, note_fault
from nathlon.terminal.streams import standard_streams

app = CommandGroup("Which of my thousands of racing checkpoints do I send to the race, and why?")

track = CommandGroup("Import circuits, make up new ones, and look at them.")
track.command("import")(import_track)
track.command("generate")(generate_track)
track.command("limit")(limit_track)
track.command("show")(show_track)

car = CommandGroup("Check car files, tune cars and make up new ones.")
car.command("check")(check_car)
car.command("generate")(generate_car)
car.command("tune")(tune_car)

world = CommandGroup("Look at simulators whose policies can be selected among.")
world.command("check")(check_world)
world.command("list")(list_worlds)

reward = CommandGroup("Rewards for training.")
reward.command("design")(design_reward)

store = CommandGroup("Look after stores.")
store.command("copy")(copy_store)
store.command("clean")(clean_store)

app.add(
    "Select",
    demo,
    evaluate,
    plan,
    init,
    nightly,
    watch,
    worker,
    status,
    report,
    pareto,
    battery,
    committee=committee,
)
app.add("Judge", gate, matrix, recipes, incident, twin)
app.add("Look", race, endurance, weekend, season, stints, drive, serve, replay, coach)
app.add("Train", train, polish, league, ablate, reward=reward)
app.add("Files", export, pack, verify, observation, track=track, car=car, world=world, store=store)


STOPPED = 130
"""Exit code after Ctrl-C."""


class _OneLine(logging.Formatter):
    """Warnings name files of others, whose names may be anything."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


def main() -> None:
    """Entry point: bad input is one sentence and exit code 2; `--json` prints JSON on every code."""
    if logging.lastResort:
        logging.lastResort.setFormatter(_OneLine())
    is_closed = sys.stdout is None
    with _ended_by(signal.SIGTERM), standard_streams() as (results, remarks):
        code = _ended(_refuse_closed if is_closed else app)
        if code and _wants_json(sys.argv[1:]) and not results.last:
            error = remarks.last.removeprefix("nathlon: ").removeprefix("Error: ")
            _ended(lambda: print_json({"error": error, "code": code}))
    sys.exit(code)


@contextmanager
def _ended_by(number: signal.Signals) -> Iterator[None]:
    """While a signal does what Ctrl-C does: schedulers end their jobs with one."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(number, interrupt)
    try:
        yield
    finally:
        signal.signal(number, before)


def _ended(command: Callable[[], object]) -> int:
    """The exit code of a command that was called; bad input and faults are said on standard error."""
    try:
        try:
            command()
        finally:
            sys.stdout.flush()
    except SystemExit as end:
        return int(end.code or 0)
    except KeyboardInterrupt:
        return STOPPED
    except InputError as error:
        warn(f"nathlon: {error}")
    except Exception as error:
        if not isinstance(error, OSError) or error.filename is None:
            warn(f"nathlon: {note_fault(error)}")
            return FAULT
        # A file or folder that its owner does not share, wherever it came up.
        warn(f"nathlon: {error.filename}: {error.strerror}; expected a file or folder that can be used")
    else:
        return 0
    return 2


def _refuse_closed() -> None:
    raise InputError("standard output: is closed, expected one that can be written")


def _wants_json(arguments: Sequence[str]) -> bool:
    """Whether `--json` is among the options."""
    return "--json" in takewhile(lambda argument: argument != "--", arguments)


if __name__ == "__main__":
    main()

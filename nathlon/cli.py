"""The command line: its commands are functions of `nathlon.commands`, loading what they need as they run."""

from __future__ import annotations

import logging
import sys

import typer

from nathlon.commands.ablate import ablate
from nathlon.commands.battery import battery
from nathlon.commands.car import check_car, generate_car, tune_car
from nathlon.commands.coach import coach
from nathlon.commands.committee_app import committee
from nathlon.commands.drive import drive
from nathlon.commands.export import export
from nathlon.commands.gate import gate
from nathlon.commands.incident import incident
from nathlon.commands.league import league
from nathlon.commands.matrix import matrix
from nathlon.commands.nightly import init, nightly, status
from nathlon.commands.observation import observation
from nathlon.commands.pareto import pareto
from nathlon.commands.plan import plan
from nathlon.commands.racing import race
from nathlon.commands.recipes import recipes
from nathlon.commands.replay import replay
from nathlon.commands.reward import design_reward
from nathlon.commands.selection import demo, evaluate, report
from nathlon.commands.serve import serve
from nathlon.commands.store import clean_store, copy_store
from nathlon.commands.track import generate_track, import_track, limit_track, show_track
from nathlon.commands.training import polish, train
from nathlon.commands.twin import twin
from nathlon.commands.worker import worker
from nathlon.commands.world import check_world, list_worlds
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable
from nathlon.terminal import warn

app = typer.Typer(
    help="Which of my thousands of racing checkpoints do I send to the race, and why?",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # rich takes longer to load than the help to read
)
for command in (
    demo, evaluate, gate, matrix, pareto, battery, init, plan, nightly, worker, status, report, train, polish,
    league, ablate, recipes, race, drive, serve, replay, twin, incident, coach, export, observation,
):  # fmt: skip
    app.command()(command)

track = typer.Typer(help="Import circuits, make up new ones, and look at them.", no_args_is_help=True)
track.command("import")(import_track)
track.command("generate")(generate_track)
track.command("limit")(limit_track)
track.command("show")(show_track)
app.add_typer(track, name="track")

car = typer.Typer(help="Check car files, tune cars and make up new ones.", no_args_is_help=True)
car.command("check")(check_car)
car.command("generate")(generate_car)
car.command("tune")(tune_car)
app.add_typer(car, name="car")

world = typer.Typer(help="Look at simulators whose policies can be selected among.", no_args_is_help=True)
world.command("check")(check_world)
world.command("list")(list_worlds)
app.add_typer(world, name="world")

reward = typer.Typer(help="Rewards for training.", no_args_is_help=True)
reward.command("design")(design_reward)
app.add_typer(reward, name="reward")

store = typer.Typer(help="Look after stores.", no_args_is_help=True)
store.command("copy")(copy_store)
store.command("clean")(clean_store)
app.add_typer(store, name="store")
app.add_typer(committee, name="committee")


class _OneLine(logging.Formatter):
    """Warnings name files of others, whose names may be anything."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


def main() -> None:
    """Entry point: bad input is one sentence and exit code 2."""
    if logging.lastResort:
        logging.lastResort.setFormatter(_OneLine())
    try:
        app()
    except InputError as error:
        warn(f"nathlon: {error}")
        sys.exit(2)
    except OSError as error:
        if error.filename is None:
            raise
        # A file or folder that its owner does not share, wherever it came up.
        warn(f"nathlon: {error.filename}: {error.strerror}; expected a file or folder that can be used")
        sys.exit(2)


if __name__ == "__main__":
    main()

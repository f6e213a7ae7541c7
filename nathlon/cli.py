"""The command line; each command imports what it needs when it runs, so that help comes at once."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from nathlon.bounds import LARGEST_SEED, MOST_PAIRS, MOST_SHORTLISTED, MOST_WORKERS
from nathlon.commands.committee_app import committee
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from nathlon.sim.names import printable

app = typer.Typer(
    help="Which of my thousands of racing checkpoints do I send to the race, and why?",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

track = typer.Typer(help="Import circuits and look at them.", no_args_is_help=True)
app.add_typer(track, name="track")
app.add_typer(committee, name="committee")

Checkpoints = Annotated[
    list[Path],
    typer.Argument(
        help="Checkpoints (.safetensors, Stable-Baselines3 .zip, .onnx), folders of them, plugin:NAME."
    ),
]
Out = Annotated[Path, typer.Option("--out", help="Folder for everything that the run leaves.")]
Seed = Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of all randomness.")]
ConfigSeed = Annotated[
    int | None,
    typer.Option(min=0, max=LARGEST_SEED, help="Seed of all randomness, in place of the configuration's."),
]
Config = Annotated[Path | None, typer.Option(help="How to select (nathlon init writes one).")]
ConfigFile = Annotated[Path, typer.Option("--config", help="How to select (nathlon init writes one).")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Workers = Annotated[
    int | None, typer.Option(min=1, max=MOST_WORKERS, help="Processes; one for each core by default.")
]
Shortlist = Annotated[
    int | None, typer.Option(min=1, max=MOST_SHORTLISTED, help="Entrants that reach the round robin.")
]
Pairs = Annotated[
    int | None,
    typer.Option(
        min=2,
        max=MOST_PAIRS,
        help="Mirrored pairs of races for every two of them, at most; an interval needs two.",
    ),
]


@app.command()
def demo(
    out: Out = Path("runs/demo"),
    seed: Seed = 1,
    shortlist: Shortlist = None,
    pairs: Pairs = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Select the best of the bundled checkpoints: filter, skill tests, round robin, report."""
    from nathlon.arena.workers import start_server

    start_server()
    from nathlon.commands.selection import configured
    from nathlon.commands.selection import evaluate as run
    from nathlon.policies.bundled import BUNDLED

    run([BUNDLED / "lindenring"], out, configured(None, seed, shortlist, pairs, workers), as_json)


@app.command()
def evaluate(
    checkpoints: Checkpoints,
    out: Out = Path("runs/evaluation"),
    config: Config = None,
    seed: ConfigSeed = None,
    shortlist: Shortlist = None,
    pairs: Pairs = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Select the best of your own checkpoints, the same way as the demo."""
    from nathlon.arena.workers import start_server

    start_server()
    from nathlon.commands.selection import configured
    from nathlon.commands.selection import evaluate as run

    run(checkpoints, out, configured(config, seed, shortlist, pairs, workers), as_json)


@app.command()
def pareto(
    checkpoints: Checkpoints,
    out: Out = Path("runs/pareto"),
    config: Config = None,
    seed: ConfigSeed = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Keep the checkpoints that may be on the Pareto front."""
    from nathlon.commands.pareto import pareto_command as run
    from nathlon.commands.selection import configured

    run(checkpoints, out, configured(config, seed, None, None, workers), as_json)


@app.command()
def battery(
    entrants: Annotated[
        list[str], typer.Argument(help="Checkpoints, folders of them, built-in drivers, plugin:NAME.")
    ],
    out: Out = Path("runs/battery"),
    config: Config = None,
    seed: ConfigSeed = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Put entrants through the n-athlon: skill tests with points."""
    from nathlon.commands.battery import battery as run
    from nathlon.commands.selection import configured

    run(entrants, out, configured(config, seed, None, None, workers), as_json)


@app.command()
def init(
    path: Annotated[Path, typer.Argument(help="The file to write.")] = Path("nathlon.toml"),
    as_json: AsJson = False,
) -> None:
    """Write a configuration for a selection every night."""
    from nathlon.commands.nightly import init as run

    run(path, as_json)


@app.command()
def nightly(
    config: ConfigFile = Path("nathlon.toml"), workers: Workers = None, as_json: AsJson = False
) -> None:
    """Select among the checkpoints that are new, and exit with a code that a scheduler understands.

    0: done, 1: nobody passed the gates, 2: bad input, 3: too many faults. The same command goes on with a
    night that was stopped.
    """
    from nathlon.commands.nightly import nightly as run

    run(config, workers, as_json)


@app.command()
def status(
    config: ConfigFile = Path("nathlon.toml"),
    verify: Annotated[
        bool, typer.Option("--verify", help="Recompute the totals of all records, and say what disagrees.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Say which nights there were, and where the one under way is."""
    from nathlon.commands.nightly import status as run

    run(config, verify, as_json)


@app.command()
def report(
    store: Annotated[str, typer.Argument(help="The store: path of its file, or URL of a database.")],
    run_name: Annotated[
        str | None, typer.Option("--run", help="Name of the run; the last by default.")
    ] = None,
    out: Out = Path("runs/report"),
    record_all: Annotated[
        bool, typer.Option("--record-all", help="Record every race of the tournament.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Make the report of a run again from its store."""
    from nathlon.commands.selection import report as run

    run(store, run_name, out, record_all, as_json)


@app.command()
def train(
    config: Annotated[
        str,
        typer.Argument(
            help="time_trial, racing (also as CIRCUIT-racing ..), paper, or the path of a .toml file."
        ),
    ] = "time_trial",
    out: Out = Path("runs/training"),
    seed: Seed = 1,
    threads: Annotated[
        int | None, typer.Option(min=1, max=MOST_WORKERS, help="Threads of the learner.")
    ] = None,
    device: Annotated[Literal["cpu", "cuda"], typer.Option(help="Where networks are updated.")] = "cpu",
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in the folder.")] = False,
    origin: Annotated[
        Path | None, typer.Option("--from", help="Folder of a run whose networks this one starts with.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Train a policy with QR-SAC; Ctrl-C stops, --resume goes on."""
    need("torch", "train", "training")
    from nathlon.commands.training import train as run

    run(config, out, seed, threads, device, resume, origin, as_json)


@app.command()
def polish(
    checkpoint: Annotated[Path, typer.Argument(help="Checkpoint to start from.")],
    config: Annotated[
        str, typer.Option(help="Training configuration whose races and reward count: name or path.")
    ] = "time_trial",
    out: Out = Path("runs/polished"),
    rounds: Annotated[int, typer.Option(min=1, max=10**9, help="Rounds of the whole.")] = 100,
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Improve a checkpoint by what its actions bring in races; the same command goes on after Ctrl-C."""
    need("torch", "train", "polishing")
    from nathlon.commands.polish import polish as run

    run(checkpoint, config, out, rounds, seed, as_json)


@app.command()
def ablate(
    config: Annotated[
        str, typer.Argument(help="time_trial, racing, or the path of a training configuration (.toml).")
    ],
    out: Out = Path("runs/ablation"),
    seeds: Annotated[
        int, typer.Option(min=1, max=10_000, help="Runs of each variant, with seeds from 1 on.")
    ] = 3,
    updates: Annotated[
        int | None,
        typer.Option(min=1, max=10**12, help="Updates of each run; the configuration's by default."),
    ] = None,
    variant: Annotated[
        list[str] | None, typer.Option(help="Train this variant; may be repeated. All by default.")
    ] = None,
    pairs: Annotated[
        int,
        typer.Option(min=0, max=MOST_PAIRS, help="Mirrored pairs of 4v4 races of each run against the base."),
    ] = 0,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_WORKERS, help="Threads of the learner, processes of the races."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Train variants of a configuration without parts of the method, and draw what the parts are worth.

    The same command goes on after Ctrl-C.
    """
    need("torch", "train", "an ablation")
    from nathlon.commands.ablate import ablate as run

    run(config, out, seeds, updates, variant or [], pairs, workers, as_json)


@app.command()
def race(
    entrants: Annotated[
        list[str],
        typer.Argument(
            help="Checkpoints, built-in drivers (driver:pace=0.95) or plugin:NAME, from pole in turn."
        ),
    ],
    scenario: Annotated[str, typer.Option(help="Name or path of the scenario.")] = "race",
    circuit: Annotated[str, typer.Option(help="Name or path of the circuit.")] = "lindenring",
    car: Annotated[str, typer.Option(help="Name or path of the car.")] = "gt3",
    seed: Seed = 1,
    qualifying: Annotated[
        bool, typer.Option("--qualify", help="Order the entrants by a flying lap first.")
    ] = False,
    record: Annotated[bool, typer.Option("--record", help="Keep the race as OUT/race.mcap.")] = False,
    out: Out = Path("runs/race"),
    as_json: AsJson = False,
) -> None:
    """Run one race and print its result; the entrants fill the grid in turn, two of them as teams."""
    from nathlon.commands.racing import race as run

    run(entrants, scenario, circuit, car, seed, qualifying, out if record else None, as_json)


@app.command()
def replay(
    source: Annotated[
        str, typer.Argument(help="Recording of a race (.mcap); with RACE, the store: its path or URL.")
    ],
    race: Annotated[
        str | None,
        typer.Argument(help="Race of the store to run again, as KEY:RACE; the first digits of the key do."),
    ] = None,
    car: Annotated[
        str | None, typer.Option(help="Name or number of the car to follow; the winner by default.")
    ] = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the viewer.")] = True,
    web: Annotated[
        bool, typer.Option("--web", help="Serve Rerun's viewer to browsers on this machine.")
    ] = False,
    html: Annotated[Path | None, typer.Option(help="Write a page that plays the race instead.")] = None,
    video: Annotated[Path | None, typer.Option(help="Write a clip (.mp4) instead.")] = None,
    start_s: Annotated[
        float | None, typer.Option("--from", help="Where the clip begins in the race, s.")
    ] = None,
    end_s: Annotated[float | None, typer.Option("--to", help="Where the clip ends, s.")] = None,
    recover: Annotated[
        bool, typer.Option("--recover", help="Save what can be read of a damaged recording.")
    ] = False,
    out: Out = Path("runs/replays"),
    as_json: AsJson = False,
) -> None:
    """Look at a race: in Rerun's viewer, in the browser, as a page of its own, or as a video."""
    from nathlon.commands import replay as command

    if recover:
        command.recover(Path(source), as_json)
    else:
        command.replay(source, race, car, out, show, web, html, video, start_s, end_s, as_json)


@app.command()
def export(
    checkpoint: Annotated[Path, typer.Argument(help="Checkpoint (.safetensors).")],
    onnx: Annotated[Path, typer.Option("--onnx", help="The ONNX file to write.")],
    as_json: AsJson = False,
) -> None:
    """Write a checkpoint as an ONNX graph, which other programs can run and nathlon can race."""
    from nathlon.commands.export import export as run

    run(checkpoint, onnx, as_json)


@app.command()
def observation(
    course_points: Annotated[int, typer.Option(help="Points on each line of the course.")] = 60,
    as_json: AsJson = False,
) -> None:
    """Print the layout of the observations that a policy gets."""
    from nathlon.commands.observation import observation as run

    run(course_points, as_json)


@track.command("import")
def import_track(
    file: Annotated[Path, typer.Argument(help="CSV file with x_m, y_m, w_tr_right_m, w_tr_left_m.")],
    name: Annotated[str, typer.Option(help="Name of the circuit: lowercase letters, digits, hyphens.")],
    out: Annotated[Path, typer.Option("--out", help="Folder that the circuit's folder goes into.")] = Path(),
    as_json: AsJson = False,
) -> None:
    """Make a circuit of a centre line from the TUM racetrack database, as the folder NAME."""
    from nathlon.commands.track import import_track as run

    run(file, name, out, as_json)


@track.command("show")
def show_track(
    name: Annotated[str, typer.Argument(help="Name or path of the circuit.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="The picture; NAME.png in this folder by default.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Draw the map of a circuit and list its sections."""
    from nathlon.commands.track import show_track as run

    run(name, out, as_json)


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
        from nathlon.commands.console import warn

        warn(f"nathlon: {error}")
        sys.exit(2)
    except OSError as error:
        if error.filename is None:
            raise
        from nathlon.commands.console import warn

        # A file or folder that its owner does not share, wherever it came up.
        warn(f"nathlon: {error.filename}: {error.strerror}; expected a file or folder that can be used")
        sys.exit(2)


if __name__ == "__main__":
    main()

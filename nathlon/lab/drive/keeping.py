"""What a test drive leaves: the person's inputs, the recording, and match and marks in a store of its own."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import NamedTuple

import polars as pl

from nathlon.arena.entrant import entrants_table
from nathlon.arena.recording import recording_name, write_recording
from nathlon.arena.store import Store
from nathlon.lab.drive.choice import UNDER_WAY, DrivePlan
from nathlon.lab.drive.heat import DrivenHeat
from nathlon.lab.drive.mark import Mark
from nathlon.policies.policy_file import content_id
from nathlon.policies.sources import HUMAN
from nathlon.policies.sources.human import write_inputs
from nathlon.selection.publish.output import OutputFolder
from nathlon.sim.names import file_stem


class Kept(NamedTuple):
    """Where a test drive is.

    Attributes:
        recording: of the race (.mcap).
        inputs: what the person did (.json).
        results: RESULTS, with the person by the id of the inputs.
    """

    recording: Path
    inputs: Path
    results: pl.DataFrame


def keep(driven: DrivenHeat, output: OutputFolder) -> Kept:
    """Keep a race, so that it can be run again from its inputs as any other of a store.

    Raises:
        InputError: if there is no room.
    """
    plan = driven.plan
    with output.filling():
        inputs = _write_inputs(driven, output.root / "inputs")
        identity, source = content_id(inputs.read_bytes()), f"{HUMAN}:{inputs}"
        entrants = (*plan.entrants[:-1], replace(plan.entrants[-1], id=identity, source=source))
        match = replace(
            plan.match,
            entrants=tuple(entrant.id for entrant in entrants),
            sources=tuple(entrant.source for entrant in entrants),
        )
        recording = output.races / recording_name(match.key, 0)
        write_recording(recording, replace(driven.log, match=match.key))
    results = driven.results.with_columns(
        pl.lit(match.key).alias("match"), pl.col("entrant").replace({UNDER_WAY: identity})
    )
    with Store(output.store) as store:
        run = f"drive {match.key[:10]}"
        store.begin_run(run, {"choice": plan.choice.model_dump(mode="json")})
        store.add_match(match.key, match.stage, match.spec(), results)
        store.use(run, [match.key])
        marks = [mark._asdict() | {"nearest": nearest(plan, mark)} for mark in driven.marks]
        store.put_fact(run, "marks", marks)
        if plan.field is not None and plan.field.forecast is not None:
            store.put_fact(run, "forecast", plan.field.forecast._asdict())
        store.put_table(run, "entrants", entrants_table(entrants))
        store.end_run(run, "done")
    return Kept(recording, inputs, results)


def nearest(plan: DrivePlan, mark: Mark) -> str | None:
    """Name of whoever drove the car nearest to the person's at a marked moment."""
    return None if mark.nearest is None else plan.grid[mark.nearest]


def _write_inputs(driven: DrivenHeat, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    choice = driven.plan.choice
    names = (folder / f"{file_stem(choice.name)}-{drive}.json" for drive in count(1))
    path = next(path for path in names if not path.exists())
    write_inputs(path, choice.name, choice.circuit, choice.car, driven.controls)
    return path

"""Running the incidents of a folder, and who passes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import polars as pl

from nathlon.arena.entrance import check_opponents
from nathlon.arena.entrant import Entrant
from nathlon.arena.results import INCIDENTS
from nathlon.arena.world_registry import home
from nathlon.selection.battery import skill_matches
from nathlon.selection.battery.measures import measured
from nathlon.selection.battery.skill import Skill, load_skills
from nathlon.selection.incident.folder import incident_files
from nathlon.selection.run import INCIDENT_RUNS, Run
from nathlon.sim.errors import InputError


def load_incidents(folder: str | None, circuit: str, car: str) -> list[Skill]:
    """The incidents of a folder that happened on a circuit with a car; none without a folder.

    Raises:
        InputError: if there is no such folder, or a file in it is wrong.
    """
    if folder is None:
        return []
    tests = load_skills([str(path) for path in incident_files(Path(folder))])
    for test in tests:
        if test.passed is None:
            raise InputError(f"{folder}: incident {test.name!r} lacks passed, expected what counts as passed")
    return [test for test in tests if (test.circuit, test.car) == (circuit, car)]


def hold_incidents(run: Run, entrants: Sequence[Entrant], folder: str | None) -> pl.DataFrame:
    """Have entrants drive the incidents of a folder: INCIDENTS.

    Raises:
        InputError: if the folder or a file in it is wrong, or an opponent cannot drive.
    """
    tests = load_incidents(folder, entrants[0].circuit, entrants[0].car) if entrants else []
    if not tests:
        return pl.DataFrame(schema=INCIDENTS)
    world = home(entrants[0])
    for test in tests:
        check_opponents(run.pool, test.opponents, entrants[0], f"incident {test.name!r}: field opponents")
    planned = {
        (test, entrant): replace(match, stage=INCIDENT_RUNS, test=test)
        for (test, entrant), match in skill_matches(entrants, tests, run.seeds("battery")).items()
    }
    results = run.results(INCIDENT_RUNS, list(planned.values()))
    frames = {str(key): frame for (key,), frame in results.partition_by("match", as_dict=True).items()}
    rows = []
    for test in tests:
        how = measured(test.measure, world)
        for entrant in entrants:
            runs = test.runs_of(frames[planned[test.name, entrant.id].key], how)
            rows.append(_row(test, entrant, runs))
    return pl.DataFrame(rows, schema=INCIDENTS)


def _row(test: Skill, entrant: Entrant, runs: Sequence[tuple[int, float | None]]) -> dict[str, object]:
    passed = test.passed
    assert passed is not None, "of an incident it is known"
    clean = sum(mark is not None and mark <= passed.at_most for _, mark in runs)
    return {
        "entrant": entrant.id,
        "test": test.name,
        "happened": test.description,
        "runs": len(runs),
        "clean": clean,
        "needed": passed.share,
        "passed": bool(runs) and clean >= passed.share * len(runs),
    }

"""`nathlon.stints`: when to stop in a race on tyres that wear."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import polars as pl

from nathlon.api.candidates import Candidate, one_source
from nathlon.arena.entrance import enter_all
from nathlon.arena.entrant import CAR, CIRCUIT
from nathlon.arena.pool import Pool
from nathlon.lab.stints.model import LapModel, fit, stint_model
from nathlon.lab.stints.planning import StopPlan, plans
from nathlon.lab.stints.practice import Place, heavy, light, practise
from nathlon.policies.sources import COMPOSITE, is_path
from nathlon.policies.stint_model import StintModel
from nathlon.results.words import counted
from nathlon.sim.car import load_car, load_compounds
from nathlon.sim.errors import InputError
from nathlon.sim.rules import load_rules, rule_parameters
from nathlon.sim.scenario import load_scenario
from nathlon.sim.whole_file import check_output, whole_file, write_whole
from nathlon.terminal.progress import stage_progress, worker_count

COMPOUNDS = ("racing-soft", "racing-medium", "racing-hard")
HEAVY, LIGHT = "full tanks", "light tanks"
"""What practice runs are called where progress is shown."""
OPENING_S = 600.0
"""What one practice run may take, s."""


class StintsResult:
    """The plans of a race, and what they rest on.

    Attributes:
        folder: of all that it has left: a composite for each plan, one with a planner, and `laps.csv`.
        laps: LAPS of `nathlon.lab.stints.practice`.
        model: of the laps.
        plans: the fastest of each number of stops, the fastest first.
        files: composites of the plans, in their order.
        planner: a composite that plans anew every lap, by the model.
    """

    def __init__(
        self,
        folder: Path,
        laps: pl.DataFrame,
        model: LapModel,
        planned: Sequence[StopPlan],
        files: Sequence[Path],
        planner: Path,
    ) -> None:
        self.folder, self.laps, self.model = folder, laps, model
        self.plans, self.files, self.planner = planned, files, planner

    @property
    def table(self) -> pl.DataFrame:
        """One row a plan: `stops`, `stints`, `expected_s`, `behind_s` the first, its `low_s` and `high_s`."""
        rows = []
        for plan, file in zip(self.plans, self.files, strict=True):
            gap, half = plan.behind(self.plans[0], self.model)
            rows.append(
                {
                    "stops": plan.stops,
                    "stints": ", ".join(f"{stint.laps} {stint.compound}" for stint in plan.stints),
                    "expected_s": plan.seconds(self.model),
                    "behind_s": gap,
                    "low_s": gap - half,
                    "high_s": gap + half,
                    "file": str(file),
                }
            )
        return pl.DataFrame(rows)

    def __repr__(self) -> str:
        return "\n".join(
            f"{counted(row['stops'], 'stop')}: {row['stints']}, {row['expected_s']:.1f} s, {row['file']}"
            for row in self.table.iter_rows(named=True)
        )

    def _repr_html_(self) -> str:
        return self.table._repr_html_()


def stints(
    policy: Candidate,
    *,
    scenario: str = "grand_prix_stops",
    circuit: str = CIRCUIT,
    car: str = CAR,
    compounds: Sequence[str] = COMPOUNDS,
    runs: int = 2,
    stops: int = 4,
    seed: int = 1,
    workers: int | None = None,
    out: str | Path = "runs/stints",
    progress: bool = True,
) -> StintsResult:
    """The fastest plan of each number of stops, for a policy alone on the road.

    The policy drives practice runs on each compound. Lap times are fitted to compound, age of the tyres and
    fuel; the plans follow by dynamic programming. Other cars are not reckoned with.

    Args:
        policy: a checkpoint, `driver:pace=0.95` or `plugin:NAME`.
        scenario: the race, in laps and with a wear rate.
        circuit, car: shipped names or paths.
        compounds: to choose among.
        runs: on each compound, at least two: half of them with a full tank and no stop.
        stops: of a plan, at most.
        seed: of the practice.
        workers: processes.
        out: folder for the plans, as composites to be raced.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if the policy cannot drive or come round, or a name is unknown.
    """
    folder = Path(out)
    check_output(folder)
    source = one_source(policy)
    if source.endswith(COMPOSITE):
        raise InputError(f"{source}: expected one policy that is no composite")
    if runs < 2:
        raise InputError(f"runs is {runs}, expected at least 2")
    _check_compounds(compounds)
    place = Place.alone(scenario, circuit, car)
    race = load_scenario(scenario)
    with (
        Pool(worker_count(workers), first_answer_s=OPENING_S) as pool,
        stage_progress(progress, (HEAVY, LIGHT)) as on_match,
    ):
        [entrant] = enter_all(pool, [source], circuit, car)
        known = practise(pool, heavy(source, place, compounds, runs // 2, seed), partial(on_match, HEAVY))
        more = practise(pool, light(source, place, known, runs - runs // 2, seed), partial(on_match, LIGHT))
        laps = pl.concat([known, more])
    model = fit(laps)
    assert race.laps is not None, "practices checks it"
    tank = load_car(car).fuel.capacity_kg
    planned = plans(model, race.laps, rule_parameters(load_rules(race.rules)).pit, tank, stops)
    folder.mkdir(parents=True, exist_ok=True)
    with whole_file(folder / "laps.csv") as partial_path:
        laps.write_csv(partial_path)
    files = [_write(folder, source, entrant.name, plan) for plan in planned]
    planner = _write_planner(folder, source, entrant.name, stint_model(model))
    return StintsResult(folder, laps, model, planned, files, planner)


def _check_compounds(compounds: Sequence[str]) -> None:
    known = ", ".join(load_compounds())
    if not compounds or not set(compounds) <= load_compounds().keys():
        raise InputError(f"compounds is {', '.join(compounds)!r}, expected some of {known}")
    if len(set(compounds)) < len(compounds):
        raise InputError(f"compounds is {', '.join(compounds)!r}, expected each once")


def _write(folder: Path, source: str, name: str, plan: StopPlan) -> Path:
    """Write a plan as a composite."""
    lines = []
    for stint in plan.stints:
        lines += ["[[stint]]", f"laps = {stint.laps}", f'compound = "{stint.compound}"']
        lines += [f"fuel_kg = {stint.fuel_kg}"]
    called = f"{name} on {counted(plan.stops, 'stop')}"
    return _composite(folder / f"{plan.stops}-stops.toml", source, called, lines)


def _write_planner(folder: Path, source: str, name: str, model: StintModel) -> Path:
    """Write the model as a composite that plans by it."""
    lines = ["[planner]"]
    lines += [f"{key} = {json.dumps(value)}" for key, value in model.model_dump(exclude={"compound"}).items()]
    for compound in model.compound:
        lines += ["[[planner.compound]]"]
        lines += [f"{key} = {json.dumps(value)}" for key, value in compound.model_dump().items()]
    return _composite(folder / "planner.toml", source, f"{name} with a planner", lines)


def _composite(path: Path, source: str, name: str, strategy: Sequence[str]) -> Path:
    """Write a composite of one policy with lines of TOML that say its strategy."""
    part = os.path.relpath(source, path.parent) if is_path(source) else source
    lines = [f"name = {json.dumps(name)}", "[[part]]", f"policy = {json.dumps(part)}", *strategy]
    write_whole(path, "\n".join(lines) + "\n")
    return path

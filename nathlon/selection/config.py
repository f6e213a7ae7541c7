"""The configuration of a selection: `nathlon.toml`."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field, model_validator

from nathlon.arena.world import KNOWN, World
from nathlon.arena.world_finding import RACING, in_folder, with_loader
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.racing import surroundings
from nathlon.policies.bundled import champion, generalist
from nathlon.policies.sources import DRIVER, GENERALIST, RANDOM
from nathlon.policies.sources.identity import policy_id
from nathlon.selection.battery import BatterySettings
from nathlon.selection.battery.skill import load_skills, standing_tests
from nathlon.selection.bounds import LARGEST_SEED, MOST_WORKERS
from nathlon.selection.committee.rules import CommitteeSettings
from nathlon.selection.gate_settings import GateSettings
from nathlon.selection.incident.hold import load_incidents
from nathlon.selection.matrix_settings import MatrixSettings
from nathlon.selection.pareto.filter import FilterSettings
from nathlon.selection.pareto.objective import OWN, RACE, Objective
from nathlon.selection.publish.recordings import Kept
from nathlon.selection.result_settings import ResultSettings
from nathlon.selection.round_robin import TournamentSettings
from nathlon.sim.data_file import Named, Section, read_toml
from nathlon.sim.errors import InputError

SectionT = TypeVar("SectionT", bound=Section)
Share = Annotated[float, Field(ge=0, le=1)]

TEMPLATE = Path(__file__).parent.parent / "data" / "nathlon.toml"
"""What `nathlon init` writes."""


class NightlySettings(Section):
    """What makes one night comparable with the next, and when a night is no good.

    Attributes:
        anchors: built-in drivers and checkpoints that race every night. Where none are given and no champion
            comes with nathlon for the circuit and car, the generalist races too.
        incumbents: the best of the nights before that race again.
        max_fault_share: of the car runs and of the new files; beyond it the night fails for its health.
        keep: how long nights keep reports, recordings and replays, such as `"90 days"`; for ever if it is not
            given. What was sent, the summary and the store's results always stay.
    """

    anchors: tuple[Named, ...] = ("driver:pace=0.95",)
    incumbents: Annotated[int, Field(ge=0, le=1000)] = 3
    max_fault_share: Share = 0.1
    keep: Annotated[str, Field(pattern=r"^[1-9][0-9]{0,4} days?$")] | None = None

    @property
    def keep_days(self) -> int | None:
        """`keep` as a number."""
        return None if self.keep is None else int(self.keep.split()[0])


class Config(Section):
    """How checkpoints are selected; every field has a default.

    Attributes:
        checkpoints: folders and files that a night watches; `plugin:NAME` too.
        circuit, car: what is raced; empty in another world.
        world: name of the simulator, see `nathlon.arena.world_finding`; ours has one with a `loader` as well.
        store: path of the SQLite file, or the URL of a PostgreSQL database.
        out: folder for the reports.
        seed: of all randomness.
        workers: processes; one for each core if it is not given.
        engine: who runs the matches: this machine, or the nodes of a Ray cluster.
        engine_address: of the cluster; `auto` for the one that this machine is part of.
        recordings: which races of the tournament leave one.
    """

    checkpoints: tuple[Named, ...] = ("checkpoints",)
    circuit: str = "lindenring"
    car: str = "gt3"
    world: Named = RACING
    store: Named = "nathlon.sqlite"
    out: Named = "nights"
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = 1
    workers: Annotated[int, Field(ge=1, le=MOST_WORKERS)] | None = None
    engine: Literal["local", "ray"] = "local"
    engine_address: Named = "auto"
    recordings: Kept = "all"
    pareto: FilterSettings = FilterSettings()
    battery: BatterySettings = BatterySettings()
    committee: CommitteeSettings = CommitteeSettings()
    tournament: TournamentSettings = TournamentSettings()
    nightly: NightlySettings = NightlySettings()
    gate: GateSettings = GateSettings()
    matrix: MatrixSettings = MatrixSettings()
    results: ResultSettings = ResultSettings()

    @model_validator(mode="before")
    @classmethod
    def _with_loader(cls, given: Any) -> Any:
        """`loader` says by which nathlon's own world reads files that it cannot read itself."""
        if not isinstance(given, Mapping) or "loader" not in given:
            return given
        loader, world = given["loader"], given.get("world", RACING)
        if not isinstance(loader, str) or not isinstance(world, str):
            raise ValueError(f"field loader is {loader!r}: expected PATH.py:NAME or MODULE:NAME")
        rest = {name: value for name, value in given.items() if name != "loader"}
        return rest | {"world": with_loader(world, loader)}

    @property
    def digest(self) -> str:
        """SHA-256 of what decides the outcome of a night, with the contents of the files that it names.

        Raises:
            InputError: if a file is missing or wrong.
        """
        elsewhere = {"out", "workers", "engine", "engine_address", "store", "checkpoints", "recordings"}
        elsewhere |= {"gate", "matrix", "results"}
        excluded: dict[str, Any] = dict.fromkeys(elsewhere, True) | {"nightly": {"keep"}}
        decisive = self.model_dump(mode="json", exclude=excluded)
        # Sorted: the files of a world come in another order in every process.
        text = json.dumps([decisive, self._contents()], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def _contents(self) -> list[Any]:
        """What the files say that the configuration names, and the ids of the filter's opponents."""
        world = load_world(self.world, self.circuit, self.car)
        skills = load_skills(self.battery.tests, world) or standing_tests(world)
        skills += load_incidents(self.battery.incidents, self.circuit, self.car)
        races = self.tournament.held(self.circuit, self.car, self.world).race
        here = {self.pareto.scenario, *(s for test in skills for s in test.scenarios)}
        if self.pareto.time_trial is not None:
            here.add(self.pareto.time_trial)
        return [
            [test.model_dump(mode="json") for test in skills],
            [race.model_dump(mode="json") for race in races],
            [self._facts(scenario, self.circuit, self.car) for scenario in sorted(here)],
            [self._facts(race.raced, race.circuit, race.car) for race in races],
            [policy_id(opponent) for opponent in self.pareto.opponents],
            [policy_id(opponent) for test in skills if test.passed for opponent in test.opponents],
        ]

    def _facts(self, scenario: str, circuit: str, car: str) -> dict[str, Any]:
        """What decides how a scenario goes, the program's own code apart where it is ours."""
        facts = load_world(self.world, circuit, car).facts(scenario)
        if not self.circuit:
            return facts
        return surroundings(scenario, circuit, car) | {
            name: value for name, value in facts.items() if name == "loader"
        }

    @property
    def in_gauntlet(self) -> bool:
        """Whether the tournament needs references, which are the anchors.

        Raises:
            InputError: if the event's file is wrong.
        """
        event = self.tournament.held(self.circuit, self.car, self.world)
        return any(race.made.gauntlet for race in event.race)

    @property
    def suited(self) -> Config:
        """The configuration with what its world has instead of defaults that are those of our circuits."""
        world = load_world(self.world)
        if world.circuits:
            return self._anchored
        first = world.scenarios[0]
        places = len(world.setup(first).sides)
        objectives = [Objective(name="score", measure="score", source=RACE, goal="max")]
        for name, measure in world.measures.items():
            own = name if name in KNOWN else OWN + name
            objectives.append(Objective(name=name, measure=own, source=RACE, goal=measure.goal))
        defaults = {
            "scenario": first,
            "slots": tuple(range(1, places + 1)),
            "most_races": self._most_races(world),
            "time_trial": None,
            "opponents": (world.baseline,),
            "objective": tuple(objectives),
        }
        pareto = {name: value for name, value in defaults.items() if name not in self.pareto.model_fields_set}
        tests = {} if "tests" in self.battery.model_fields_set else {"tests": ()}
        sides = max(len(world.setup(name).sides) for name in world.scenarios)
        cells = {
            "scenarios": world.scenarios,
            "places": tuple(range(1, sides + 1)),
            "margins": {"score": 0.0} | {OWN + name: 0.0 for name in world.measures if name not in KNOWN},
        }
        matrix = {name: value for name, value in cells.items() if name not in self.matrix.model_fields_set}
        anchors = {} if "anchors" in self.nightly.model_fields_set else {"anchors": (world.baseline,)}
        return self.model_copy(
            update={
                "circuit": "",
                "car": "",
                "pareto": self.pareto.model_copy(update=pareto),
                "battery": self.battery.model_copy(update=tests),
                "nightly": self.nightly.model_copy(update=anchors),
                "matrix": self.matrix.model_copy(update=matrix),
            }
        )

    @property
    def _anchored(self) -> Config:
        """The configuration with an anchor that has learnt, where nothing else that has knows the circuit."""
        if "anchors" in self.nightly.model_fields_set:
            return self
        try:
            champion(self.circuit, self.car)
        except InputError:
            anchors = (*self.nightly.anchors, str(generalist()))
            return self.model_copy(update={"nightly": self.nightly.model_copy(update={"anchors": anchors})})
        return self

    def _most_races(self, world: World) -> int:
        """Races of the filter that take everybody equally often to each of its sides."""
        scenario = self.pareto.scenario if "scenario" in self.pareto.model_fields_set else world.scenarios[0]
        slots = len(self.pareto.slots) or len(world.setup(scenario).sides)
        return -(-self.pareto.most_races // slots) * slots


def read_config(path: Path) -> Config:
    """Read `nathlon.toml`; paths in it start from the folder that it is in.

    Raises:
        InputError: if the file cannot be read, or a field is unknown or out of range.
    """
    config, root = read_toml(path, Config, "configuration"), path.parent

    def located(name: str) -> str:
        """A path from the configuration's folder; names of drivers, plug-ins and databases as they are."""
        if "\0" in name:
            raise InputError(f"{path}: {name!r} is no path: a name has no zero byte")
        if name == GENERALIST:
            return str(generalist())
        return name if ":" in name or name in (DRIVER, RANDOM) else os.path.abspath(root / name)

    def files(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(located(name) if name.endswith(".toml") else name for name in names)

    event = config.tournament.event
    return config.model_copy(
        update={
            "world": in_folder(config.world, root),
            "checkpoints": tuple(map(located, config.checkpoints)),
            "store": located(config.store),
            "out": located(config.out),
            "battery": _changed(
                _changed(config.battery, "tests", files), "incidents", lambda name: name and located(name)
            ),
            "gate": _changed(config.gate, "tests", files),
            "matrix": _changed(
                _changed(config.matrix, "scenarios", files),
                "opponents",
                lambda names: tuple(map(located, names)),
            ),
            "tournament": config.tournament.model_copy(update={"event": event and located(event)}),
            "nightly": _changed(config.nightly, "anchors", lambda names: tuple(map(located, names))),
            "results": _changed(
                config.results, "tensorboard", lambda name: name if name.startswith("$") else located(name)
            ),
        }
    )


def _changed(section: SectionT, field: str, change: Callable[[Any], Any]) -> SectionT:
    """A section with a field changed if it was given; what was not stays a default, which worlds replace."""
    if field not in section.model_fields_set:
        return section
    return section.model_copy(update={field: change(getattr(section, field))})

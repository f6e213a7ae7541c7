"""Running a league: polish the parent among the population, have all meet, decide who goes on, and again."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path

from nathlon.arena.entrance import enter_all
from nathlon.arena.pool import Pool
from nathlon.lab.league.generation import (
    Generation,
    Met,
    conclude,
    members,
    read_generation,
    write_generation,
)
from nathlon.lab.league.settings import LeaguePlan
from nathlon.policies.sources.identity import policy_id
from nathlon.policies.training.config import Opponent, TrainingConfig
from nathlon.policies.training.polish import Polish, Round
from nathlon.results.selection import Selection
from nathlon.selection.field import EntryList
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.round_robin import run_round_robin
from nathlon.selection.run import OnMatch
from nathlon.selection.single_run import single_run
from nathlon.selection.single_selection import single_selection
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.whole_file import whole_file, write_whole, writing

LEAGUE_FILE = "league.json"
STORE = "store.sqlite"
SELECTION = "selection"
"""Folder of the last word."""
NAME = "generation-{:02d}"
"""Of a generation's folder, and of the entrant that it has made."""

OnRound = Callable[[int, Round], None]
"""Told the number of the generation and where its polishing stands."""
OnPair = Callable[[int, int], None]
"""Told how many pairs of circuit and car have been practised, and of how many."""


class League:
    """A league in a folder of its own.

    Attributes:
        generations: those that have met.
        store: with all their results.
    """

    def __init__(self, plan: LeaguePlan, folder: Path) -> None:
        """A league at its beginning, or where it stopped in the folder.

        Raises:
            InputError: if the folder cannot be written or holds something else.
        """
        self._plan, self._folder = plan, folder
        self.store = folder / STORE
        _claim(folder, plan)
        self.generations: list[Generation] = []
        while (made := read_generation(self.folder(len(self.generations)))) is not None:
            self.generations.append(made)

    def folder(self, number: int) -> Path:
        """Of a generation."""
        return self._folder / NAME.format(number)

    @property
    def over(self) -> bool:
        """Whether it has come to what it is for, or to its last generation."""
        met = self.generations
        return bool(met) and (met[-1].reached or len(met) > self._plan.settings.generations)

    def step(self, pool: Pool, on_round: OnRound, on_pair: OnPair, on_match: OnMatch) -> Generation:
        """The next generation: polish, meet, decide. What is done of it is kept after KeyboardInterrupt.

        Args:
            pool: where matches run.
            on_round: told of each round of polishing.
            on_pair: told what is practised before, where many pairs of circuit and car are driven.
            on_match: told about races.

        Raises:
            InputError: if an entrant cannot be read any more, or a file cannot be written.
        """
        number, before = len(self.generations), self.generations[-1] if self.generations else None
        settings = self._plan.settings
        if before is None:
            sources, newcomer = list(self._plan.sources), None
        else:
            newcomer = self._polished(number, before, on_round, on_pair)
            sources = [member.source for member in before.population] + [str(newcomer)]
        seed = settings.seed + 1 + number  # the seed itself is the last selection's
        config = self._plan.selection.model_copy(update={"seed": seed})
        entrants = enter_all(pool, sources, config.circuit, config.car)
        with single_run("league", entrants, config, self.store, pool, on_match) as run:
            run.compile(config.world, config.circuit, config.car)
            answer, _ = run_round_robin(run, entrants, config.tournament)
            run.keep(answer.tables)
        met = Met(answer.tables["ranking"], answer.tables["ratings"], answer.results)
        generation = conclude(
            number,
            members(entrants, met),
            settings.population,
            settings.stop,
            before,
            None if newcomer is None else policy_id(str(newcomer)),
        )
        write_generation(self.folder(number), generation)
        self.generations.append(generation)
        return generation

    def decide(self, pool: Pool, on_match: OnMatch) -> tuple[OutputFolder, Selection | None]:
        """The last word: a whole selection among the first entrants and the last population.

        Args:
            pool: where matches run.
            on_match: told about races.

        Returns:
            where it has left its report, and what this shows; None where people must vote first.

        Raises:
            InputError: if an entrant cannot be read any more, or a file cannot be written.
        """
        config = self._plan.selection
        sources = [*self._plan.sources, *(member.source for member in self.generations[-1].population)]
        entrants = enter_all(pool, sources, config.circuit, config.car)
        output = OutputFolder(self._folder / SELECTION, str(self.store))
        return output, single_selection(EntryList(tuple(entrants)), output, config, pool, on_match)

    def _polished(self, number: int, before: Generation, on_round: OnRound, on_pair: OnPair) -> Path:
        """The newcomer of a generation: its parent, polished among the population."""
        folder, settings = self.folder(number), self._plan.settings
        path = folder / f"{NAME.format(number)}.safetensors"
        if path.exists():
            return path
        source = Path(before.member(before.parent).source)
        work = Polish(source, self.training(before), folder, settings.rounds, settings.seed + number)
        work.run(lambda done: on_round(number, done), on_pair)
        last = folder / "checkpoints" / f"round-{settings.rounds:05d}.safetensors"
        with writing(path), whole_file(path) as partial:
            shutil.copyfile(last, partial)
        return path

    def training(self, generation: Generation) -> TrainingConfig:
        """The training configuration with the population that a generation has left as opponents."""
        opponents = tuple(
            Opponent(policy=member.source, weight=max(member.weight, 1e-6))
            for member in generation.population
        )
        return self._plan.training.model_copy(update={"opponents": opponents})


def _claim(folder: Path, plan: LeaguePlan) -> None:
    """Say in the folder which league it is of.

    Raises:
        InputError: if it is of another.
    """
    facts = {
        "entrants": [policy_id(source) for source in plan.sources],
        "training": plan.training.model_dump(mode="json"),
        "selection": plan.selection.digest,
        "settings": plan.settings.model_dump(mode="json", include={"rounds", "population", "pairs", "seed"}),
    }
    told = {name: hashlib.sha256(json.dumps(fact).encode()).hexdigest() for name, fact in facts.items()}
    path = folder / LEAGUE_FILE
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            write_whole(path, json.dumps(told, indent=1) + "\n")
            return
    try:
        found = json.loads(read_text(path, "league"))
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise InputError(f"{path}: expected the JSON of a league")
    for name, digest in told.items():
        if found.get(name) != digest:
            raise InputError(f"{path}: is of another league: other {name}; choose another folder")

"""What a league is made of, as a TOML file says it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from pydantic import Field

from nathlon.arena.world_finding import RACING
from nathlon.policies.checkpoint import ANY, read_card
from nathlon.policies.sources.finding import find_sources
from nathlon.policies.sources.identity import policy_id
from nathlon.policies.training.config import CONFIGS, Rollouts, TrainingConfig
from nathlon.policies.training.config import read_config as read_training
from nathlon.selection.bounds import LARGEST_SEED, MOST_PAIRS
from nathlon.selection.config import Config
from nathlon.selection.config import read_config as read_selection
from nathlon.sim.data_file import Section, find_data, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario


class StopRule(Section):
    """When a league has come to what it is for.

    Attributes:
        at_fault_per_km: contacts that the stewards lay to a car, a kilometre, at most.
        points: team points a race that may be lost against the best of the first entrants.
    """

    at_fault_per_km: Annotated[float, Field(ge=0, le=100)] = 0.02
    points: Annotated[float, Field(ge=0, le=100)] = 0.0


class LeagueSettings(Section):
    """A league.

    Attributes:
        entrants: checkpoints that it begins with, or folders of them.
        training: configuration whose races and reward count in polishing, a shipped name or a path; its
            opponents, of rollouts that name none of their own, are the population.
        selection: path of a `nathlon.toml`, whose tournament rates and whose stages decide at the end.
        rounds: of polishing in a generation.
        generations: at most.
        population: entrants that meet, and drive as opponents, at most.
        pairs: mirrored pairs of races for every two of them, at most, instead of the selection's.
        seed: of all randomness.
        stop: when it has come to what it is for; without it it ends after its generations.
    """

    entrants: Annotated[tuple[str, ...], Field(min_length=1)]
    training: str
    selection: str | None = None
    rounds: Annotated[int, Field(ge=1, le=10**9)] = 40
    generations: Annotated[int, Field(ge=1, le=10_000)] = 5
    population: Annotated[int, Field(ge=2, le=100)] = 6
    pairs: Annotated[int, Field(ge=2, le=MOST_PAIRS)] | None = None
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = 1
    stop: StopRule | None = None


class LeaguePlan(Section):
    """A league with the files that it names read.

    Attributes:
        settings: of its own file.
        sources: checkpoints that it begins with.
        training: what is polished in.
        selection: how it is rated and decided, with circuit and car.
    """

    settings: LeagueSettings
    sources: tuple[str, ...]
    training: TrainingConfig
    selection: Config


def read_league(path: Path) -> LeaguePlan:
    """Read and check the file of a league; paths in it start from the folder that it is in.

    Raises:
        InputError: if a file cannot be read, or a field is missing, unknown or out of range.
    """
    settings = read_toml(path, LeagueSettings, "league")

    def located(name: str) -> str:
        return os.path.abspath(path.parent / name)

    name = settings.training
    training = read_training(
        Path(located(name)) if name.endswith(".toml") else find_data(name, "training configuration", CONFIGS)
    )
    if not any(_among_population(rollouts) for rollouts in training.rollouts):
        raise InputError(
            f"{path}: training {name}: no rollouts race the population, "
            "expected some with other cars that name no opponents of their own"
        )
    if settings.selection is None:
        selection = Config(recordings="notable")
    else:
        selection = read_selection(Path(located(settings.selection)))
        if selection.world != RACING:
            raise InputError(
                f"{path}: selection {settings.selection}: world is {selection.world!r}, "
                "expected nathlon's own, where policies are polished"
            )
    here = {name: value for name in ("circuit", "car") if (value := getattr(training, name)) != ANY}
    tournament = selection.tournament
    if settings.pairs is not None:
        tournament = tournament.model_copy(update={"pairs": settings.pairs})
    selection = selection.model_copy(update={**here, "tournament": tournament, "seed": settings.seed})
    sources = find_sources([located(name) for name in settings.entrants])
    for source in sources:
        card = read_card(Path(source))
        for field in ("circuit", "car"):
            made_for, wanted = getattr(card, field), getattr(training, field)
            if made_for != wanted:
                raise InputError(
                    f"{path}: entrant {source}: {field} is {made_for!r}, expected {wanted!r}, "
                    "as in the training configuration"
                )
    if len({policy_id(source) for source in sources}) < 2:
        raise InputError(f"{path}: entrants is one checkpoint, expected two or more that can meet")
    return LeaguePlan(settings=settings, sources=tuple(sources), training=training, selection=selection)


def _among_population(rollouts: Rollouts) -> bool:
    """Whether the population drives in some races."""
    others = load_scenario(rollouts.scenario).cars > rollouts.learners
    return others and not rollouts.opponents and not rollouts.demonstrators

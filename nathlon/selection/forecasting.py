"""What a selection will cost and can find, from its configuration and the selections before it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log, sqrt
from typing import Any

import numpy as np

from nathlon.arena.store import Store
from nathlon.arena.world_registry import load_world
from nathlon.results.forecast import Budget, Forecast, StageForecast
from nathlon.results.summary import Stage, Summary
from nathlon.selection.battery import MARKS_RUNS
from nathlon.selection.battery.skill import load_skills, standing_tests
from nathlon.selection.config import Config
from nathlon.selection.pareto.objective import RACE
from nathlon.selection.run import CONFIDENCE
from nathlon.tournament.event import Event
from nathlon.tournament.power import POWER, detectable, race_count

MORE = (1, 2, 4, 8)
"""Times the configured pairs for which it is said what the round robin would find."""


@dataclass(frozen=True)
class Habits:
    """How selections of a kind have gone.

    Attributes:
        earlier: how many.
        front: survivors of the filter for every (ln n)^(d - 1) of n entrants and d objectives: so the front
            of random points grows (Bentley et al., J. ACM 25, 1978).
        filtering, racing: share of the races that the configuration allows, of filter and round robin.
        core_s: processor time of a race by stage, s, as far as it is known.
        deviation: of the difference of two entrants from one unit to the next, points a race; None where it
            is not known.
    """

    earlier: int
    front: float
    filtering: float
    racing: float
    core_s: dict[str, float]
    deviation: float | None


ASSUMED = Habits(
    earlier=0,
    front=0.9,
    filtering=0.7,
    racing=0.7,
    core_s={"pareto": 0.2, "battery": 0.08, "tournament": 0.3},
    deviation=4.0,
)
"""Without an earlier selection: see docs/plan.md for what they are from."""


def forecast(
    config: Config,
    newcomers: int,
    incumbents: int,
    anchors: int,
    habits: Habits,
    workers: int,
    episode_s: float | None = None,
) -> Forecast:
    """What a selection is expected to cost, and what its round robin can find.

    Args:
        config: how it is selected.
        newcomers, incumbents, anchors: how many take part; see `nathlon.selection.field.EntryList`.
        habits: how earlier ones have gone.
        workers: processes.
        episode_s: what an episode of random policies took here, s, if one was played.
    """
    entered = newcomers + incumbents
    survivors = min(newcomers, max(1, round(habits.front * _growth(entered, config))))
    filtering = _filter_races(config) * entered
    battery = _battery_races(config, survivors + incumbents)
    event = config.tournament.held(config.circuit, config.car, config.world)
    finalists = min(survivors, config.committee.shortlist) + incumbents
    pairs = config.tournament.pairs
    racing = race_count(event, finalists, anchors, pairs)
    stages = (
        ("pareto", entered, round(habits.filtering * filtering), filtering),
        ("battery", survivors + incumbents, battery, battery),
        ("tournament", finalists + anchors, round(habits.racing * racing), racing),
    )
    return Forecast(
        newcomers=newcomers,
        earlier=habits.earlier,
        workers=workers,
        stages=tuple(_stage(*stage, habits) for stage in stages),
        deviation=habits.deviation,
        power=POWER,
        budgets=tuple(
            _budget(config, event, finalists, anchors, times * pairs, habits.deviation)
            for times in MORE
            if racing and habits.deviation is not None
        ),
        episode=load_world(config.world).episode,
        episode_s=episode_s,
    )


def effect(config: Config, finalists: int, anchors: int, deviation: float) -> float:
    """The least true difference of two finalists, points a race, that the round robin finds with `POWER`."""
    event = config.tournament.held(config.circuit, config.car, config.world)
    return _effect(config, event, finalists, anchors, config.tournament.pairs, deviation)


def habits_of(
    summaries: Sequence[Summary], config: Config, episode_s: Mapping[str, float] | None = None
) -> Habits:
    """How earlier selections have gone; what none of them tells is assumed.

    Args:
        summaries: of the earlier ones.
        config: of the one to come.
        episode_s: what an episode takes in another world, by scenario, s, where it was measured.
    """
    assumed = ASSUMED
    if not load_world(config.world).circuits:
        assumed = replace(ASSUMED, core_s=_stage_times(config, episode_s or {}), deviation=None)
    if not summaries:
        return assumed
    deviations = [summary.unit_deviation**2 for summary in summaries if summary.unit_deviation is not None]
    return Habits(
        earlier=len(summaries),
        front=_mean((_front(summary, config) for summary in summaries), ASSUMED.front),
        filtering=_mean((_filtering(summary, config) for summary in summaries), ASSUMED.filtering),
        racing=_mean((_racing(summary, config) for summary in summaries), ASSUMED.racing),
        core_s=assumed.core_s | _core_s([stage for summary in summaries for stage in summary.stages]),
        deviation=sqrt(np.mean(deviations)) if deviations else assumed.deviation,
    )


def _stage_times(config: Config, episode_s: Mapping[str, float]) -> dict[str, float]:
    """Time of an episode by stage, as far as that of its scenarios is known, s."""
    world = load_world(config.world)
    tests = load_skills(config.battery.tests, world) or standing_tests(world)
    event = config.tournament.held(config.circuit, config.car, config.world)
    held = {
        "pareto": [config.pareto.scenario],
        "battery": [test.scenario for test in tests],
        "tournament": [race.raced for race in event.race],
    }
    return {
        stage: float(np.mean([episode_s[scenario] for scenario in scenarios]))
        for stage, scenarios in held.items()
        if scenarios and set(scenarios) <= episode_s.keys()
    }


def earlier(store: Store, config: Config, before: str | None = None) -> list[Summary]:
    """Summaries of the selections in a store of the same world, circuit and car.

    Args:
        store: where they are.
        config: of the selection that is forecast.
        before: the run that they must have come before; None for all.
    """
    found: list[Summary] = []
    for record in store.runs():
        if record.name == before:
            break
        kept: Any = store.facts(record.name).get("summary")
        if kept is not None:
            summary = Summary.model_validate(kept)
            if (summary.world, summary.circuit, summary.car) == (config.world, config.circuit, config.car):
                found.append(summary)
    return found


def _stage(name: str, entrants: int, races: int, most: int, habits: Habits) -> StageForecast:
    each = habits.core_s.get(name) if races else 0.0
    return StageForecast(
        name=name,
        entrants=entrants,
        races=races,
        most_races=most,
        core_s=None if each is None else each * races,
    )


def _budget(
    config: Config, event: Event, finalists: int, anchors: int, pairs: int, deviation: float
) -> Budget:
    return Budget(
        pairs=pairs,
        races=race_count(event, finalists, anchors, pairs),
        effect=_effect(config, event, finalists, anchors, pairs, deviation),
    )


def _effect(
    config: Config, event: Event, finalists: int, anchors: int, pairs: int, deviation: float
) -> float:
    looks = -(-pairs // config.tournament.block) if config.tournament.sequential else 1
    return detectable(event, finalists, anchors, pairs, deviation, CONFIDENCE, looks)


def _growth(entrants: int, config: Config) -> float:
    return max(1.0, log(max(entrants, 1))) ** (len(config.pareto.objective) - 1)


def _filter_races(config: Config) -> int:
    """Races and time trials of an entrant that the filter allows."""
    raced = any(objective.source == RACE for objective in config.pareto.objective)
    return sum(config.pareto.rounds) * (raced + (config.pareto.time_trial is not None))


def _battery_races(config: Config, entrants: int) -> int:
    """Runs of all skill tests, with those of whoever sets the marks."""
    world = load_world(config.world)
    tests = load_skills(config.battery.tests, world) or standing_tests(world)
    runs = sum(config.battery.runs or test.runs for test in tests)
    return runs * entrants + MARKS_RUNS * len(tests) * (entrants > 0)


def _of(summary: Summary, name: str) -> Stage | None:
    return next((stage for stage in summary.stages if stage.name == name), None)


def _front(summary: Summary, config: Config) -> float | None:
    stage = _of(summary, "pareto")
    return None if stage is None else stage.left / _growth(stage.entered, config)


def _filtering(summary: Summary, config: Config) -> float | None:
    stage = _of(summary, "pareto")
    return None if stage is None else stage.races / (_filter_races(config) * stage.entered)


def _racing(summary: Summary, config: Config) -> float | None:
    stage = _of(summary, "tournament")
    if stage is None or not stage.races:
        return None
    event = config.tournament.held(config.circuit, config.car, config.world)
    anchors = len(config.nightly.anchors) if config.in_gauntlet else 0
    most = race_count(event, stage.entered - anchors, anchors, config.tournament.pairs)
    return min(1.0, stage.races / most) if most > 0 else None


def _core_s(stages: Iterable[Stage]) -> dict[str, float]:
    """Processor time of a race, by stage, of those that ran their races themselves."""
    told = [stage for stage in stages if stage.ran]
    return {
        name: sum(s.core_s for s in told if s.name == name) / sum(s.ran for s in told if s.name == name)
        for name in {stage.name for stage in told}
    }


def _mean(values: Iterable[float | None], otherwise: float) -> float:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else otherwise

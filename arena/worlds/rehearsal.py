"""Trying out a world: whether its episodes repeat, lose no rows and bear a policy that fails."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import polars as pl
from scipy.special import stdtrit

from nathlon.arena.job import Opening
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.results import POLICY_FAULTS, RESULTS, VOID_ENDINGS
from nathlon.arena.rounding import differing
from nathlon.arena.statistics import Floats, holm, p_values
from nathlon.arena.watch import Watch
from nathlon.arena.world import Measure, Setup, World
from nathlon.arena.world_finding import is_racing
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.environment import GymnasiumWorld, PettingZooWorld
from nathlon.arena.worlds.host import InTurn
from nathlon.arena.worlds.repeats import Elsewhere, Played, any_policy, differs, repeated, starts
from nathlon.policies.sources import RANDOM
from nathlon.sim.errors import InputError

PATIENCE_S = 600.0
"""A part of a check that takes longer hangs."""
FAIR_S = 60.0
"""What the episodes may take, about, by which sides are compared."""
FEW, MANY = 4, 20
"""Of them at least and at most."""
API_CYCLES = 100
"""Steps of PettingZoo's own tests."""
EXPECTED = "expected episodes that come of the seed of reset alone"


@dataclass(frozen=True)
class RehearsalFinding:
    """What a check has found.

    Attributes:
        scenario: where; '' of the world as a whole.
        fault: whether the world cannot be used so.
        says: a sentence.
        warning: whether a selection will tell less than it seems to.
    """

    scenario: str
    fault: bool
    says: str
    warning: bool = False


@dataclass(frozen=True)
class Rehearsed:
    """A scenario that was tried out.

    Attributes:
        name: of the scenario.
        setup: what it says about itself.
        episode_s: what an episode of random policies takes here, s.
    """

    name: str
    setup: Setup
    episode_s: float


@dataclass(frozen=True)
class RehearsalReport:
    """What came of a check.

    Attributes:
        world: its name.
        scenarios: those that could be opened.
        measures: that it declares, by name.
        findings: all of them.
    """

    world: str
    scenarios: tuple[Rehearsed, ...]
    measures: dict[str, Measure]
    findings: tuple[RehearsalFinding, ...]

    @property
    def faults(self) -> list[RehearsalFinding]:
        """Those for which the world cannot be used."""
        return [finding for finding in self.findings if finding.fault]


def rehearse(pool: Pool, name: str) -> RehearsalReport:
    """Try a world out in a watched process: one that hangs, exits or prints harms nobody.

    Raises:
        InputError: if it cannot be loaded.
    """
    if is_racing(name):
        raise InputError(f"world {name!r}: is nathlon's own, expected one to be checked")
    scenarios, measures = _sure(_watched(pool, name, "", _declared, name))
    findings: list[RehearsalFinding] = []
    tried: list[Rehearsed] = []
    elsewhere = Elsewhere(name, os.environ.get("PYTHONHASHSEED", ""), PATIENCE_S)
    for scenario in scenarios:
        answer = _watched(pool, name, scenario, _rehearsed, name, scenario)
        if isinstance(answer, InputError):
            findings.append(RehearsalFinding(scenario, True, f"{answer}."))
            continue
        rehearsed, found, played = answer
        tried.append(rehearsed)
        if not any(finding.fault for finding in found):
            found += _again(elsewhere, name, rehearsed, played)
        findings += found
        if any(finding.fault for finding in found):
            continue
        for part in (_compared, _tested):
            answer = _watched(pool, name, scenario, part, name, scenario, rehearsed.episode_s)
            refused = isinstance(answer, InputError)
            findings += [RehearsalFinding(scenario, True, f"{answer}.")] if refused else answer
    elsewhere.close()
    return RehearsalReport(name, tuple(tried), measures, tuple(findings))


def episode_times(pool: Pool, name: str) -> dict[str, float]:
    """What an episode of random policies takes, by scenario, s; played in a watched process.

    Raises:
        InputError: if a scenario cannot be played.
    """
    scenarios, _ = _sure(_watched(pool, name, "", _declared, name))
    return {scenario: _sure(_watched(pool, name, scenario, _timed, name, scenario)) for scenario in scenarios}


def _sure(answer: Any) -> Any:
    if isinstance(answer, InputError):
        raise answer
    return answer


def _timed(name: str, scenario: str) -> float:
    """The time of an episode, s; where it is short of a second one, as the first may load what it needs."""
    world = load_world(name)
    setup, policy = world.setup(scenario), any_policy(world)
    match = _match(world, scenario, setup, (1,))
    for _ in range(2):
        began = time.perf_counter()
        _played(world, match, [policy])
        took_s = time.perf_counter() - began
        if took_s >= 1.0:
            break
    return took_s


def _watched(pool: Pool, name: str, scenario: str, function: Any, *arguments: Any) -> Any:
    where = f"world {name!r}, scenario {scenario!r}" if scenario else f"world {name!r}"
    expected = "a scenario that can be played" if scenario else "a world"
    [answer] = pool.open([Opening(where, function, arguments, expected=expected)])
    return answer


def _declared(name: str) -> tuple[tuple[str, ...], dict[str, Measure]]:
    world = load_world(name)
    if not world.scenarios:
        raise InputError(f"world {name!r}: has no scenarios, expected at least one")
    return world.scenarios, dict(world.measures)


def _rehearsed(name: str, scenario: str) -> tuple[Rehearsed, list[RehearsalFinding], list[Played]]:
    """Play the same episodes again and again, and one in which a policy fails; and those episodes."""
    world = load_world(name)
    world.check(scenario)
    setup = world.setup(scenario)
    if not any(setup.sides):
        raise InputError(
            f"world {name!r}, scenario {scenario!r}: has no side, expected one that entrants take"
        )
    policy = any_policy(world)
    where = _where(name, scenario)
    match = _match(world, scenario, setup, (1,))
    fault = _fault(world, where, setup, _played(world, match, [policy]))
    began = time.perf_counter()
    fault = fault or _fault(world, where, setup, _played(world, match, [policy]))
    took_s = time.perf_counter() - began
    rehearsed = Rehearsed(scenario, setup, took_s)
    if fault:
        return rehearsed, [RehearsalFinding(scenario, True, fault)], []
    played, other = repeated(world, scenario, setup, took_s)
    if other:
        return rehearsed, [RehearsalFinding(scenario, True, f"{where}, {other}, {EXPECTED}.")], []
    if any(row["ending"] in VOID_ENDINGS for episode in played for row in episode.rows):
        said = getattr(world, "fault", "") or f"{where}: an episode is void"
        return rehearsed, [RehearsalFinding(scenario, True, f"{said}.")], []
    said = f"An episode of random policies takes {took_s:.3g} s: {3600 / took_s:,.0f} an hour and process."
    findings = [RehearsalFinding(scenario, False, sentence) for sentence in (*_repeats(played), said)]
    if alike := starts(played):
        findings.append(RehearsalFinding(scenario, False, alike, warning=True))
    return rehearsed, [*findings, _with_failure(world, scenario, setup, policy, where)], played


def _repeats(played: Sequence[Played]) -> tuple[str, str]:
    """What is known where nothing has differed, and what is not."""
    seeds = len({episode.seed for episode in played})
    steps = sum(len(seen) for episode in played for seen in episode.seen)
    again = len(played) - seeds
    return (
        "An episode with the same seed and seats repeats to the bit.",
        f"Compared were {len(played)} episodes on {seeds} seeds in turn ({steps:,} observations, scores and "
        "ends), and two in another process with another hash seed: what shows in less than "
        f"{100 * min(3 / again, 1):.0f} % of the episodes may stay unseen.",
    )


def _again(
    elsewhere: Elsewhere, name: str, rehearsed: Rehearsed, played: Sequence[Played]
) -> list[RehearsalFinding]:
    """Play the same episodes in another process, and see whether they are still the same."""
    where = _where(name, rehearsed.name)
    first = {episode.seed: episode for episode in reversed(played)}
    there = elsewhere.play(rehearsed.name)
    if isinstance(there, str):
        return [
            RehearsalFinding(rehearsed.name, True, f"{where}: in another process {there}, expected episodes.")
        ]
    for episode in there:
        said = differs(rehearsed.setup, first[episode.seed], episode)
        if said:
            said = f"{where}, {said} in another process with another hash seed, {EXPECTED}"
            return [
                RehearsalFinding(
                    rehearsed.name, True, f"{said} and no order of sets, hash of text or draw at import."
                )
            ]
    return []


def _where(name: str, scenario: str) -> str:
    return f"world {name!r}, scenario {scenario!r}"


def _match(world: World, scenario: str, setup: Setup, seeds: Sequence[int], out: Sequence[int] = ()) -> Match:
    """Races in which a second entrant has the seats `out`, and a first one the others."""
    seats = tuple(Seat(int(seat in out)) for seat in range(len(setup.seats)))
    sources = (RANDOM, "raising")[: 1 + bool(out)]
    races = tuple(Race(seed, seats) for seed in seeds)
    return Match("check", scenario, scenario, "", "", sources, sources, races, world.name)


def _played(world: World, match: Match, policies: list[Any]) -> pl.DataFrame:
    [(_, rows)] = world.run({0: (match, policies)}, Watch())
    return rows


def _fault(world: World, where: str, setup: Setup, rows: pl.DataFrame) -> str:
    """What is wrong with the rows of one episode, in a sentence, or ''."""
    if rows.schema != RESULTS:
        return f"{where}: its rows are not as nathlon.arena.results.RESULTS says."
    missing = [name for seat, name in enumerate(setup.seats) if seat not in rows["car"]]
    if missing:
        return f"{where}, seat {missing[0]!r}: has no row, expected one for every seat."
    if rows.height != len(setup.seats):
        return f"{where}: gives {rows.height} rows, expected {len(setup.seats)}, one a seat."
    if rows["ending"].is_in(VOID_ENDINGS).any():
        return f"{getattr(world, 'fault', '') or where + ': an episode is void'}."
    blamed = rows.filter(pl.col("ending").is_in(POLICY_FAULTS))
    if blamed.height:
        seat, ending = blamed["car"][0], blamed["ending"][0]
        return f"{where}, seat {setup.seats[seat]!r}: a random policy ends as {ending}, expected to play."
    return ""


class _Raising:
    """A policy that fails when it is first asked."""

    precise = False

    def initial_memory(self, n: int) -> Any:
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Any, memory: Any) -> Any:
        raise ValueError("a policy that raises, to see what comes of it")


def _with_failure(world: World, scenario: str, setup: Setup, policy: Any, where: str) -> RehearsalFinding:
    out = setup.sides[0]
    rows = _played(world, _match(world, scenario, setup, (2,), out), [policy, _Raising()])
    seat = setup.seats[out[0]]
    if rows["ending"].is_in(VOID_ENDINGS).any():
        fault = getattr(world, "fault", "")
        said = f" ({fault})" if fault else ""
        return RehearsalFinding(
            scenario, True, f"{where}, seat {seat!r}: void when its policy raises{said}, expected to go on."
        )
    for row in rows.iter_rows(named=True):
        failed, here = row["ending"] in POLICY_FAULTS, row["car"] in out
        if failed != here:
            seat = setup.seats[row["car"]]
            wanted = "a fault of the policy, which raised" if here else "another's fault not to be its own"
            return RehearsalFinding(
                scenario, True, f"{where}, seat {seat!r}: ends as {row['ending']}, expected {wanted}."
            )
    return RehearsalFinding(scenario, False, "A policy that raises is out, and the others play on.")


def _compared(name: str, scenario: str, episode_s: float) -> list[RehearsalFinding]:
    """Whether the sides get alike many points if the same policy has them all."""
    world = load_world(name)
    setup = world.setup(scenario)
    if len(setup.sides) < 2:
        return []
    count = int(np.clip(FAIR_S / max(episode_s, 1e-6), FEW, MANY))
    rows = _played(world, _match(world, scenario, setup, range(10, 10 + count)), [any_policy(world)])
    void = rows.filter(pl.col("ending").is_in(VOID_ENDINGS))
    if void.height:
        return [RehearsalFinding(scenario, True, f"{getattr(world, 'fault', '') or 'An episode is void'}.")]
    points = rows.sort("race", "car")["points"].to_numpy().reshape(count, len(setup.seats))
    sides = np.stack([points[:, list(side)].sum(axis=1) for side in setup.sides], axis=1)
    return [RehearsalFinding(scenario, False, said) for said in fairness(sides)]


def fairness(points: Floats) -> list[str]:
    """What the points (episodes, sides) of one policy on all sides tell about them, in sentences."""
    episodes = len(points)
    pairs = list(combinations(range(points.shape[1]), 2))
    gaps = np.stack([points[:, one] - points[:, other] for one, other in pairs], axis=1)
    gaps = differing(gaps, np.abs(points).max())
    mean, error = gaps.mean(axis=0), gaps.std(axis=0, ddof=1) / np.sqrt(episodes)
    if not gaps.any():
        return [f"In {episodes} episodes of one policy all sides get the same: fairness does not show."]
    sure = holm(p_values(mean, error, np.full(len(pairs), episodes - 1.0))) <= 0.05
    reach = error * stdtrit(episodes - 1, 0.975)
    unfair = []
    for (one, other), gap, half, differ in zip(pairs, mean, reach, sure, strict=True):
        if differ:
            better, worse = (one, other) if gap > 0 else (other, one)
            unfair.append(
                f"Side {better + 1} gets {abs(gap):.3g} points an episode more than side {worse + 1} with "
                f"the same policy on both (95 % interval {abs(gap) - half:.3g} to {abs(gap) + half:.3g}): no "
                "fault, as sides are changed in every unit."
            )
    return unfair or [f"In {episodes} episodes of one policy no side gets more than another beyond chance."]


def _tested(name: str, scenario: str, _: float) -> list[RehearsalFinding]:
    world = load_world(name)
    if not isinstance(world, PettingZooWorld) or isinstance(world, GymnasiumWorld) or world.foreign:
        return []
    return [RehearsalFinding(scenario, False, said) for said in farama_says(world, scenario)]


def farama_says(world: PettingZooWorld, scenario: str) -> list[str]:
    """What PettingZoo's own tests say of an environment in this interpreter, in sentences."""
    from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test

    def made() -> Any:
        environment = world.made(scenario)
        return environment.environment if isinstance(environment, InTurn) else environment

    in_turn = isinstance(world.made(scenario), InTurn)
    api, seeds = (api_test, seed_test) if in_turn else (parallel_api_test, parallel_seed_test)
    tests: dict[str, Callable[[], Any]] = {
        api.__name__: lambda: api(made(), API_CYCLES),
        seeds.__name__: lambda: seeds(made, API_CYCLES),
    }
    told = []
    for test, call in tests.items():
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            try:
                call()
            except MemoryError:
                raise
            # It is foreign code, and an assertion may say nothing.
            except (Exception, SystemExit) as error:
                said = f"fails: {type(error).__name__} ({error})"
            else:
                said = f"passes, but warns: {str(warned[0].message).rstrip('.')}" if warned else "passes"
        told.append(f"PettingZoo's {test} {said}.")
    return told

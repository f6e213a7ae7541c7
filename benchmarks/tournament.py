"""A round robin as one batch a match beside the same races one at a time.

Run as `python -m benchmarks.tournament [--json FILE] [--share 0.1] [--races 2]`; the last line of the
output is one JSON object. Twelve bundled checkpoints of the Lindenring, the shortest circuit with so many,
all with hidden layers 256 x 2, meet 4v4, every two of them in 10 mirrored pairs of three laps: 1,320 races.
Its entries:

- `wall_s`: of all matches in `workers` processes of the arena, once these have started. Only a share of the
  matchups is raced, drawn at random, and the time extrapolated;
- `one_at_a_time_s`: of the same races one after the other in one process: the PettingZoo environment is
  stepped, and each car's policy asked by itself, as one loops over `model.predict` of
  Stable-Baselines3. Only a few are run, from matchups drawn at random, and the time is extrapolated;
- `ratio`: the second over the first;
- `matchups`, `share`: how many matchups were raced, and which part of all that is.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

from benchmarks.result import write_result
from nathlon import sim
from nathlon.arena.entrant import Entrant, enter, only_once
from nathlon.arena.match import Match
from nathlon.arena.match_policies import match_policies
from nathlon.arena.pool import Pool
from nathlon.policies.bundled import BUNDLED
from nathlon.selection.round_robin import plan
from nathlon.tournament.event import Event, EventRace

CIRCUIT, CAR = "lindenring", "gt3"
SCENARIO = str(Path(__file__).with_name("three_laps.toml"))
RUN, ENTRANTS = "lindenring-s1", 12
"""A bundled run, and how many of its last checkpoints take part."""
PAIRS = 10
WORKERS = 2
SEED = 2024


def entrants() -> list[Entrant]:
    """Twelve bundled checkpoints."""
    paths = sorted((BUNDLED / CIRCUIT).glob(f"{RUN}-*.safetensors"))[-ENTRANTS:]
    return only_once([enter(str(path), CIRCUIT, CAR) for path in paths])


def round_robin(racing: Sequence[Entrant], pairs: int) -> list[Match]:
    """All matches, one a matchup."""
    race = EventRace(name="4v4", circuit=CIRCUIT, car=CAR, scenario=SCENARIO)
    fixtures = plan(Event(race=(race,)), [racing], pairs, np.random.SeedSequence(SEED))
    return [fixture.match(slice(None)) for fixture in fixtures]


def batched_s(matches: Sequence[Match], console: Console) -> float:
    """Seconds for matches in worker processes that have started and loaded their kernels."""
    with Pool(WORKERS) as pool:
        short = round_robin(entrants()[:3], 1)[:WORKERS]
        with closing(pool.run(short)) as warm:
            list(warm)
        began = time.perf_counter()
        with closing(pool.run(matches)) as results:
            for _ in track(results, "In batches", len(matches), console=console):
                pass
        return time.perf_counter() - began


def one_at_a_time_s(matches: Sequence[Match], console: Console) -> float:
    """Mean seconds of the first race of each match, every car's policy asked by itself."""
    seconds = []
    for match in track(matches, "One at a time", console=console):
        policies, race = match_policies(match), match.races[0]
        env = sim.parallel_env(match.circuit, match.car, match.scenario, policies[0].observation_spec)
        drivers = dict(zip(env.possible_agents, (policies[seat.entrant] for seat in race.seats), strict=True))
        memory = {agent: driver.initial_memory(1) for agent, driver in drivers.items()}
        began = time.perf_counter()
        seen, _ = env.reset(seed=race.seed)
        while env.agents:
            actions = {}
            for agent in env.agents:
                action, memory[agent] = drivers[agent].act(seen[agent][None], memory[agent])
                actions[agent] = action[0]
            seen, *_ = env.step(actions)
        seconds.append(time.perf_counter() - began)
    return float(np.mean(seconds))


def measure(share: float, races: int, console: Console) -> dict[str, Any]:
    """The figures."""
    matches = round_robin(entrants(), PAIRS)
    drawn = np.random.default_rng(SEED).permutation(len(matches))
    raced = [matches[index] for index in drawn[: max(2 * WORKERS, round(share * len(matches)))]]
    wall_s = batched_s(raced, console) * len(matches) / len(raced)
    alone = [matches[index] for index in drawn[: races + 1]]
    one_at_a_time_s(alone[:1], console)  # loads the kernels
    all_races = sum(len(match.races) for match in matches)
    alone_s = one_at_a_time_s(alone[1:], console) * all_races
    return {
        "wall_s": round(wall_s, 1),
        "one_at_a_time_s": round(alone_s, 1),
        "ratio": round(alone_s / wall_s, 1),
        "matchups": len(raced),
        "share": round(len(raced) / len(matches), 3),
        "races": all_races,
        "races_one_at_a_time": races,
        "workers": WORKERS,
    }


def main() -> None:
    """Measure, show progress on stderr, print the figures as JSON."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.tournament", description="Batched against one at a time"
    )
    parser.add_argument("--json", type=Path, nargs="?", help="file for the figures as well")
    parser.add_argument("--share", type=float, default=0.1, help="of the matchups that is raced")
    parser.add_argument("--races", type=int, default=2, help="to run one at a time")
    chosen = parser.parse_args()
    figures = measure(chosen.share, chosen.races, Console(stderr=True))
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()

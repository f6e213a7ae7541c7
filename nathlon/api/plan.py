"""`nathlon.plan`: what a selection will cost and can find, before it runs."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from nathlon.api.candidates import Candidates, named_sources
from nathlon.api.selection import configured
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.rehearsal import PATIENCE_S, episode_times
from nathlon.policies.sources.identity import policy_id
from nathlon.results.forecast import Forecast
from nathlon.selection.config import Config
from nathlon.selection.forecasting import earlier, forecast, habits_of
from nathlon.selection.nightly.night import awaited
from nathlon.sim.errors import InputError
from nathlon.terminal.progress import worker_count


def plan(
    checkpoints: Candidates | None = None,
    *,
    config: Config | str | Path | None = None,
    pairs: int | None = None,
    workers: int | None = None,
    world: str | None = None,
    store: str | Path | None = None,
) -> Forecast:
    """What a selection is expected to cost, and the least difference that its round robin finds.

    It rests on the earlier selections in the configuration's store, and where there is none on the figures of
    `docs/plan.md`; in another world an episode of each scenario is then played with random policies, to see
    how long it takes. Nothing else is raced, and no checkpoint is opened.

    Args:
        checkpoints: who takes part; without any, what the next night would judge.
        config: how to select, or the path of a `nathlon.toml`.
        pairs, workers: instead of the configuration's: mirrored pairs of races for every two finalists, at
            most; processes.
        world: the simulator, instead of the configuration's.
        store: where earlier selections are, instead of the configuration's.

    Raises:
        InputError: if a name or file is wrong, or nothing is new.
    """
    settings = configured(config, pairs=pairs, workers=workers, world=world).suited
    with ExitStack() as stack:
        target = str(store or settings.store)
        there = "://" in target or Path(target).exists()
        known = stack.enter_context(Store.open(target)) if there else None
        if checkpoints is None:
            counts = awaited(settings, known)
        else:
            anchors = len(settings.nightly.anchors) if settings.in_gauntlet else 0
            sources = named_sources(checkpoints, endings=load_world(settings.world).loaders)
            counts = len({policy_id(source) for source in sources}), 0, anchors
        before = [] if known is None else earlier(known, settings)
    if counts[0] == 0:
        raise InputError("nothing is new, expected checkpoints that no night has judged")
    times = {} if before or settings.circuit else _measured(settings.world)
    return forecast(
        settings,
        *counts,
        habits_of(before, settings, times),
        worker_count(settings.workers),
        max(times.values(), default=None),
    )


def _measured(world: str) -> dict[str, float]:
    """What an episode takes in another world, by scenario, s."""
    with Pool(1, first_answer_s=PATIENCE_S) as pool:
        return episode_times(pool, world)

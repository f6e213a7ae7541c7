"""What the runs of an ablation came to: one table of all checkpoints, and races of the last ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import polars as pl
from scipy.special import stdtrit

from nathlon.arena.entrant import Entrant, enter
from nathlon.arena.match import Match
from nathlon.arena.pool import run_matches
from nathlon.arena.statistics import precision, standard_error
from nathlon.arena.store import Store
from nathlon.policies.training.ablation import BASE, AblationRun
from nathlon.reports.ablation import ABLATION, EFFECTS, last_checkpoints
from nathlon.selection.round_robin import tournament_matches
from nathlon.tournament.points import matchups

CHECKPOINT = ("variant", "seed", "updates")
DUELS = pl.Schema({name: ABLATION[name] for name in (*CHECKPOINT, "score_difference", "contacts_per_km")})

CONFIDENCE = 0.95
"""Of the intervals of EFFECTS."""


def checkpoints(runs: Sequence[AblationRun], duels: pl.DataFrame) -> pl.DataFrame:
    """All checkpoints of some runs so far (ABLATION), with the races (DUELS) of some of them."""
    curves = [
        pl.read_csv(run.curve, null_values="nan", schema_overrides=ABLATION)
        .with_columns(variant=pl.lit(run.variant), seed=pl.lit(run.seed, pl.Int64))
        .select(name for name in ABLATION if name not in DUELS or name in CHECKPOINT)
        for run in runs
        if run.curve.exists()
    ]
    if not curves:
        return pl.DataFrame(schema=ABLATION)
    return pl.concat(curves).join(duels, on=CHECKPOINT, how="left", maintain_order="left")


def effects(table: pl.DataFrame) -> pl.DataFrame:
    """What the last checkpoints (of ABLATION) of each variant differ from the base's, EFFECTS.

    Intervals are Welch's, by Student's t with the variances among the seeds. Where those of the variant or
    the base are one or all alike there is none. Where a seed has no lap, laps have no difference.
    """
    last = last_checkpoints(table)
    base = last.filter(variant=BASE)["lap_s"]
    rows = []
    for variant in last["variant"].unique(maintain_order=True):
        if variant == BASE:
            continue
        own = last.filter(variant=variant)
        rows.append((variant, "lap_s", own.height, *_difference([own["lap_s"], base], [1.0, -1.0])))
        if len(scores := own["score_difference"].drop_nulls()):
            rows.append((variant, "score_difference", len(scores), *_difference([scores], [1.0])))
    return pl.DataFrame(rows, EFFECTS, orient="row").fill_nan(None)


def _difference(groups: Sequence[pl.Series], weights: Sequence[float]) -> tuple[float, float, float]:
    """The weighted sum of the groups' means and its interval; NaN where it is not known."""
    if any(group.is_empty() or group.has_nulls() for group in groups):
        return np.nan, np.nan, np.nan
    estimate = sum(weight * group.to_numpy().mean() for weight, group in zip(weights, groups, strict=True))
    if any(group.n_unique() < 2 for group in groups):
        return estimate, np.nan, np.nan
    known = precision(pl.concat(groups).to_numpy(), np.array([len(group) for group in groups]))
    (error,), (freedom,) = standard_error(np.array([weights]), known)
    half = stdtrit(freedom, (1 + CONFIDENCE) / 2) * error
    return estimate, estimate - half, estimate + half


def race_base(
    runs: Sequence[AblationRun], pairs: int, workers: int, store: Store, on_match: Callable[[int, int], None]
) -> pl.DataFrame:
    """Race the last checkpoint of every variant, 4v4, against that of the base with the same seed.

    Args:
        runs: of variants and base.
        pairs: mirrored pairs of races for each; all variants get the same starts.
        workers: processes.
        store: keeps finished matches, which do not run again.
        on_match: told matches done and matches in all.

    Returns:
        the DUELS of the variants.
    """
    duels = _duels(runs, pairs)
    missing = [match for _, _, match in duels if not store.has(match.key)]
    done = len(duels) - len(missing)
    on_match(done, len(duels))
    for match, results in run_matches(missing, workers):
        store.add_match(match.key, match.stage, match.spec(), results)
        done += 1
        on_match(done, len(duels))
    return pl.concat([pl.DataFrame(schema=DUELS), *(_score(*duel, store) for duel in duels)])


def _duels(runs: Sequence[AblationRun], pairs: int) -> list[tuple[AblationRun, Entrant, Match]]:
    """The match of each variant's run against the base, if both have a checkpoint and not the same."""
    entrants = [
        (run, enter(str(path), run.config.circuit, run.config.car))
        for run in runs
        if (path := run.last_checkpoint)
    ]
    base = {run.seed: entrant for run, entrant in entrants if run.variant == BASE}
    return [
        (run, entrant, match)
        for run, entrant in entrants
        if run.seed in base and base[run.seed].id != entrant.id
        for match in tournament_matches([entrant, base[run.seed]], pairs, np.random.SeedSequence(run.seed))
    ]


def _score(run: AblationRun, entrant: Entrant, match: Match, store: Store) -> pl.DataFrame:
    """The variant's side of its match, DUELS."""
    table = matchups(store.results_of([match.key]), np.random.default_rng(run.seed))
    return (
        table.filter(pl.col("entrant") == entrant.id)
        .select(
            "contacts_per_km",
            variant=pl.lit(run.variant),
            seed=pl.lit(run.seed, pl.Int64),
            updates=pl.lit(entrant.step, pl.Int64),
            score_difference="difference",
        )
        .select(DUELS.names())
    )

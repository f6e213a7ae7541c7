"""The race that decided: the one to look at first."""

from __future__ import annotations

from collections.abc import Mapping

import polars as pl

from arena.match import Match
from arena.pool import match_policies
from arena.recorder import record_race
from arena.recording import write_recording
from arena.store import Store
from nathlon.output import OutputFolder
from reports.replay import write_replay


def deciding_race(results: pl.DataFrame, ranking: pl.DataFrame) -> tuple[str, int] | None:
    """The closest race that the first of the ranking won against the second, as match key and race.

    If the first won none, the race that it lost by least. None where the two did not meet.
    """
    if ranking.height < 2:
        return None
    first, second = ranking["entrant"][:2]
    met = results.filter(pl.col("entrant").is_in([first, second]))
    points = met.group_by("match", "race", "entrant").agg(pl.col("points").sum())
    margins = points.pivot("entrant", index=["match", "race"], values="points")
    if not {first, second} <= set(margins.columns):
        return None
    closest = (
        margins.drop_nulls()
        .with_columns(margin=pl.col(first) - pl.col(second))
        .with_columns(lost=pl.col("margin") <= 0, by=pl.col("margin").abs())
        .sort("lost", "by", "match", "race")
    )
    return None if closest.is_empty() else (closest["match"][0], int(closest["race"][0]))


def record_decider(
    store: Store, results: pl.DataFrame, tables: Mapping[str, pl.DataFrame], output: OutputFolder
) -> dict[str, str | None]:
    """Run the deciding race once more, record it, and say where its files are from the report's folder."""
    decider = deciding_race(results, tables["ranking"])
    if decider is None:
        return {"replay": None, "recording": None}
    key, race = decider
    entrants = tables["entrants"]
    match = Match.from_spec(store.spec(key), dict(entrants.select("entrant", "source").iter_rows()))
    names = dict(entrants.select("entrant", "name").iter_rows())
    log = record_race(match, match_policies(match), race, [names[entrant] for entrant in match.entrants])
    recording, replay = output.races / "final.mcap", output.replays / "final.rrd"
    write_recording(recording, log)
    write_replay(log, replay)
    return {"replay": f"../replays/{replay.name}", "recording": f"../races/{recording.name}"}

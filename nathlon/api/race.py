"""`nathlon.race`: one race, and its result."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import polars as pl

from nathlon.api.candidates import Candidates, named_sources
from nathlon.arena.entrance import endings_of, enter_all
from nathlon.arena.entrant import CAR, CIRCUIT, Entrant
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match
from nathlon.arena.pool import Pool
from nathlon.arena.qualifying import qualify as drive_qualifying
from nathlon.arena.recording import write_recording
from nathlon.arena.single_race import single_race
from nathlon.arena.stints import read
from nathlon.arena.workers import need_worker
from nathlon.arena.world_finding import RACING, with_loader
from nathlon.selection.publish.output import OutputFolder
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import check_output
from nathlon.terminal.progress import busy

DOING = "Racing; who does not know the circuit practises there first"
STINTS = pl.Schema(
    {
        "place": pl.Int64,
        "name": pl.String,
        "compound": pl.String,
        "laps": pl.Int64,
        "stood_s": pl.Float64,  # in the box at the stop that ended it; null of the last, as the next
        "lane_s": pl.Float64,  # in the pit lane, standing included
    }
)
"""Schema of `RaceResult.stints`."""


class RaceResult:
    """How a race went.

    Attributes:
        results: `nathlon.arena.results.RESULTS` with names, by place.
        qualifying: `name` and `lap_s` (null without a time), the fastest first; None without qualifying.
        recording: of the race (.mcap), for `nathlon replay`; None where none was asked for.
        printed: by policies that are code.
    """

    def __init__(
        self,
        results: pl.DataFrame,
        qualifying: pl.DataFrame | None,
        recording: Path | None,
        printed: str,
    ) -> None:
        self.results, self.qualifying = results, qualifying
        self.recording, self.printed = recording, printed

    @property
    def stints(self) -> pl.DataFrame:
        """One row a stint of each car that has a strategist: `place`, `name`, and `DrivenStint`'s fields."""
        rows = [
            {"place": row["place"], "name": row["name"], **stint._asdict()}
            for row in self.results.iter_rows(named=True)
            for stint in read(row["stints"])
        ]
        return pl.DataFrame(rows, schema=STINTS)

    def __repr__(self) -> str:
        return "\n".join(
            f"{row['place']:>3} {row['name']}: {_time_of(row)}" for row in self.results.iter_rows(named=True)
        )

    def _repr_html_(self) -> str:
        columns = ("place", "name", "ending", "race_time_s", "best_lap_s", "contacts", "penalties")
        return self.results.select(columns)._repr_html_()


def _time_of(row: dict[str, object]) -> str:
    time_s = row["race_time_s"]
    return str(row["ending"]).replace("_", " ") if time_s is None else f"{time_s:.3f} s"


def race(
    entrants: Candidates,
    *,
    scenario: str = "race",
    circuit: str = CIRCUIT,
    car: str = CAR,
    loader: str | None = None,
    seed: int = 1,
    qualify: bool = False,
    record: str | Path | None = None,
    progress: bool = True,
) -> RaceResult:
    """Run one race. The entrants fill the grid in turn; two of them race as teams.

    Args:
        entrants: checkpoints, `generalist`, `driver:pace=0.95`, `plugin:NAME`, `human:FILE` or objects, from
            pole in turn.
        scenario, circuit, car: shipped names or paths.
        loader: what reads files of other libraries: `PATH.py:NAME` or `MODULE:NAME`.
        seed: of all randomness.
        qualify: order the entrants by a flying lap first.
        record: folder to keep the race in, as `races/race.mcap`.
        progress: whether to show on standard error for how long it goes on.

    Raises:
        InputError: if one cannot drive, a name is unknown, or there are more entrants than places.
    """
    if record is not None:
        check_output(Path(record))
    with Pool(1) as pool, busy(DOING, progress):
        world = RACING if loader is None else with_loader(RACING, loader)
        sources = named_sources(entrants, people=True, endings=endings_of(pool, world))
        pool.here = not need_worker(sources)
        entered = enter_all(pool, sources, circuit, car, world)
        timed = drive_qualifying(pool, entered, seed) if qualify else None
        if timed is not None:
            entered = [entrant for entrant, _ in timed]
        match = single_race(entered, scenario, seed)
        output = OutputFolder(Path(record)) if record else None
        [(_, results)] = pool.run([match])
        recording = _record(pool, match, results, entered, output) if output else None
    names = {entrant.id: entrant.name for entrant in entered}
    return RaceResult(
        results.sort("place").select(pl.col("entrant").replace_strict(names).alias("name"), pl.all()),
        None if timed is None else _qualifying(timed),
        recording,
        pool.log.text,
    )


def _qualifying(timed: Sequence[tuple[Entrant, float | None]]) -> pl.DataFrame:
    return pl.DataFrame(
        {"name": [entrant.name for entrant, _ in timed], "lap_s": [lap_s for _, lap_s in timed]},
        schema={"name": pl.String, "lap_s": pl.Float64},
    )


def _record(
    pool: Pool, match: Match, results: pl.DataFrame, entrants: Sequence[Entrant], output: OutputFolder
) -> Path:
    names = tuple(entrant.name for entrant in entrants)
    [(_, answer)] = pool.record([Wanted(match, (0,), names, results)])
    if isinstance(answer, InputError):
        raise answer
    path = output.races / "race.mcap"
    with output.filling():
        write_recording(path, answer.logs[0])
    return path

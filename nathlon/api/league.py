"""`nathlon.league`: policies polished among their own kind, generation after generation."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from nathlon.api.selection import SelectionResult
from nathlon.arena.pool import Pool
from nathlon.lab.league.generation import Generation
from nathlon.lab.league.league import League
from nathlon.lab.league.settings import read_league
from nathlon.lab.league.table import table, write_table
from nathlon.policies.training.polish import Round
from nathlon.sim.folder_lock import sole_user
from nathlon.terminal.progress import progress_bars, worker_count


class LeagueResult:
    """What a league came to, and where it has left everything.

    Attributes:
        folder: of all that it has left.
        generations: that have met, the first entrants first.
        selection: the last word, among the first entrants and the last population.
    """

    def __init__(self, folder: Path, generations: list[Generation], selection: SelectionResult) -> None:
        self.folder, self.generations, self.selection = folder, generations, selection

    @property
    def reached(self) -> bool:
        """Whether it has come to what it is for, before its generations were over or with the last."""
        return self.generations[-1].reached

    @property
    def best(self) -> Path:
        """The checkpoint that it would go on with: of the first rank, least at fault."""
        last = self.generations[-1]
        return Path(last.member(last.parent).source)

    @property
    def table(self) -> pl.DataFrame:
        """A row for each member of each generation, see `nathlon.lab.league.table.GENERATIONS`."""
        return table(self.generations)

    def __repr__(self) -> str:
        last = self.generations[-1]
        best = last.member(last.parent)
        told = "reached what it is for" if last.reached else "ended"
        return f"League {told} after {last.number} generations with {best.name} in {self.folder}"

    def _repr_html_(self) -> str:
        shown = ("generation", "name", "points_per_race", "contacts_per_km", "at_fault_per_km", "penalties")
        return self.table.filter("parent").select(shown)._repr_html_()


def league(
    config: str | Path,
    out: str | Path = "runs/league",
    *,
    workers: int | None = None,
    progress: bool = True,
) -> LeagueResult:
    """Polish policies among their own kind until they are clean, or for as many generations as are given.

    The same call goes on with a league that was stopped; with more generations it goes on from its last one.

    Args:
        config: path of the file of the league.
        out: folder for everything that it leaves.
        workers: processes of the races; one for each core by default.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if a file is wrong, an entrant cannot drive, or the folder is of another league, is in use
            or cannot be written.
        KeyboardInterrupt: after Ctrl-C, once what is done is kept.
    """
    plan, folder = read_league(Path(config)), Path(out).absolute()
    total = plan.settings.generations
    with sole_user(folder), Pool(worker_count(workers)) as pool, progress_bars(progress) as bars:
        made = League(plan, folder)
        overall = bars.add_task("generations", total=total, completed=len(made.generations), note="")
        rounds = bars.add_task("rounds", total=plan.settings.rounds, note="", visible=False)
        matches = bars.add_task("matches", total=None, note="", visible=False)

        def on_round(number: int, done: Round) -> None:
            note = f"of generation {number}, reward {done.reward:.1f}"
            bars.update(rounds, completed=done.rounds, note=note, visible=True)

        def on_pair(ready: int, count: int) -> None:
            bars.update(rounds, note=f"{ready} of {count} circuits and cars practised", visible=True)

        def on_match(stage: str, done: int, all_: int) -> None:
            bars.update(matches, completed=done, total=all_, note=stage, visible=True)

        while not made.over:
            met = made.step(pool, on_round, on_pair, on_match)
            write_table(folder, made.generations)
            bars.update(overall, completed=met.number, note=_note(met))
        output, selection = made.decide(pool, on_match)
    decided = SelectionResult(output.root, selection, output.store)
    return LeagueResult(folder, made.generations, decided)


def _note(met: Generation) -> str:
    """Who goes on from a generation, for those who look on."""
    best = met.member(met.parent)
    fault = "" if best.at_fault_per_km is None else f", at fault {best.at_fault_per_km:.3f} per km"
    return f"{best.name}: {best.points_per_race:.1f} points{fault}"

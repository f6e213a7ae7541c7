"""`nathlon.select`: the whole selection, and what it came to."""

from __future__ import annotations

import base64
from collections.abc import Callable
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import polars as pl

from nathlon.api.candidates import Candidates, find_candidates
from nathlon.arena.entrance import check_world, endings_of, enter_found, trained_on
from nathlon.arena.pool import Pool, quietly
from nathlon.arena.world_finding import with_loader
from nathlon.arena.world_registry import load_world
from nathlon.policies.sources.finding import Found
from nathlon.reports.picture import ranking_picture
from nathlon.reports.verdict import Verdict, verdict
from nathlon.results.ranks import written_rank
from nathlon.results.selection import Selection
from nathlon.results.summary import SetAside, Summary
from nathlon.selection.config import Config, SectionT, read_config
from nathlon.selection.field import EntryList
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.run import OPENED
from nathlon.selection.single_selection import OnVerdict, single_selection
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable
from nathlon.sim.process import typed
from nathlon.sim.whole_file import check_output
from nathlon.terminal.progress import stage_progress, worker_count

POINTS = ("points_per_race", "points_low", "points_high")


class SelectionResult:
    """What a selection came to, and where it has left everything.

    In a notebook it shows the verdict, a picture and the ranking.

    Attributes:
        folder: of all that it has left.
        selection: all its tables; None while people must vote first.
        store: with every result: path of its file, or URL of a database.
    """

    def __init__(self, folder: Path, selection: Selection | None, store: Path | str | None = None) -> None:
        self.folder, self.selection = folder, selection
        self.store = store or folder / "store.sqlite"

    def _decided(self) -> Selection:
        if self.selection is None:
            raise InputError(f"{self.folder}: undecided, expected a run that has come to its end")
        return self.selection

    @property
    def report(self) -> Path:
        """The page."""
        return self.folder / "report" / "index.html"

    @property
    def spreadsheet(self) -> Path:
        """The ranked spreadsheet."""
        return self.folder / "report" / "ranking.xlsx"

    @property
    def recording(self) -> Path | None:
        """The deciding race (.mcap), for `nathlon replay`; None where there is none."""
        recording = self.summary.recording
        return None if recording is None else (self.report.parent / recording).resolve()

    @property
    def summary(self) -> Summary:
        """What `summary.json` holds.

        Raises:
            InputError: while people must vote first; the same holds for what follows.
        """
        return self._decided().summary

    @property
    def verdict(self) -> Verdict:
        """Who to send and why, in a headline and at most three sentences."""
        return verdict(self._decided())

    @property
    def sent(self) -> list[str]:
        """Names of whom the committee sends; empty where nobody is fit."""
        return [entrant.name for entrant in self.summary.sent]

    @property
    def ranking(self) -> pl.DataFrame:
        """The round robin, best first: RANKING and RECORDS of `nathlon.arena.results`, with names."""
        return self._table("ranking")

    @property
    def matchups(self) -> pl.DataFrame:
        """Every two of the round robin: `nathlon.arena.results.MATCHUPS` with names."""
        names = self._decided().tables["entrants"].select(opponent="entrant", opponent_name="name")
        return self._table("matchups").join(names, on="opponent", how="left", maintain_order="left")

    @property
    def skills(self) -> pl.DataFrame:
        """The n-athlon by test: `nathlon.arena.results.SKILLS` with names."""
        return self._table("skills")

    @property
    def battery(self) -> pl.DataFrame:
        """The n-athlon in all, best first: `nathlon.arena.results.BATTERY` with names."""
        return self._table("battery")

    @property
    def pareto(self) -> pl.DataFrame:
        """The filter: `nathlon.arena.results.PARETO` with names."""
        return self._table("pareto")

    def _table(self, name: str) -> pl.DataFrame:
        selection = self._decided()
        names = selection.tables["entrants"].select("entrant", "name")
        found = selection.ranking if name == "ranking" else selection.tables[name]
        table = found.join(names, on="entrant", how="left", maintain_order="left")
        return table.select("name", pl.exclude("name"))

    def __repr__(self) -> str:
        if self.selection is None:
            return f"The committee waits for its members: {typed('committee', self.store, 'show')}"
        told = self.verdict
        return "\n".join([told.headline, *told.sentences, f"Report: {self.report}"])

    def _repr_html_(self) -> str:
        if self.selection is None:
            return f"<p>{escape(repr(self))}</p>"
        told = self.verdict
        means = self.ranking["mean"].is_not_null().any()
        heading = self.summary.a_mean if means else f"Points {self.summary.an_episode}"
        picture = base64.b64encode(ranking_picture(self.ranking, heading)).decode()
        points = ("mean", "mean_low", "mean_high", "won", "drawn", "lost") if means else POINTS
        ranges = self.ranking.select("rank", "worst_rank").iter_rows()
        ranks = pl.Series("rank", [written_rank(*both) for both in ranges], dtype=pl.String)
        shown = self.ranking.select(ranks, "name", *points, "contacts_per_km", "races")
        return (
            f"<h3>{escape(told.headline)}</h3>"
            + "".join(f"<p>{escape(sentence)}</p>" for sentence in told.sentences)
            + f'<img alt="{escape(heading.lower())}" src="data:image/png;base64,{picture}">'
            + shown._repr_html_()
            + f"<p>Report: {escape(str(self.report))}</p>"
        )


def select(
    checkpoints: Candidates,
    out: str | Path = "runs/selection",
    *,
    config: Config | str | Path | None = None,
    seed: int | None = None,
    shortlist: int | None = None,
    pairs: int | None = None,
    workers: int | None = None,
    world: str | None = None,
    loader: str | None = None,
    store: str | None = None,
    progress: bool = True,
    on_verdict: OnVerdict | None = None,
) -> SelectionResult:
    """Select the best of some checkpoints: filter, n-athlon, committee, round robin, report.

    The same call goes on with a selection that was stopped. Objects race in this process, files in others.

    Args:
        checkpoints: who takes part; a folder stands for all checkpoints below it.
        out: folder for everything that the selection leaves.
        config: how to select, or the path of a `nathlon.toml`; the standard way by default.
        seed, shortlist, pairs, workers: instead of the configuration's: of all randomness; entrants that
            reach the round robin; mirrored pairs of races for every two of them, at most; processes.
        world: the simulator, instead of the configuration's: `MODULE:NAME`, `PATH.py:NAME`, or a name that a
            package offers.
        loader: in nathlon's own world, what reads files of other libraries: `PATH.py:NAME` or `MODULE:NAME`.
        store: where everything is kept, path or URL, so that workers elsewhere can take part; a file in the
            folder by default.
        progress: whether to show it, on standard error.
        on_verdict: told what was decided, before report and recordings are made.

    Raises:
        InputError: if a checkpoint cannot drive, a name or file is wrong, or the folder cannot be written.
    """
    settings = configured(config, seed, shortlist, pairs, workers, world, loader)
    check_output(Path(out))
    with Pool(worker_count(settings.workers)) as pool:
        found = find_candidates(checkpoints, endings=endings_of(pool, settings.world))
        with stage_progress(progress) as on_match:
            field, settings = entered(pool, found, settings, partial(on_match, OPENED))
            output = OutputFolder(Path(out), store)
            selection = single_selection(field, output, settings, pool, on_match, on_verdict)
    return SelectionResult(output.root, selection, output.store)


def configured(
    config: Config | str | Path | None,
    seed: int | None = None,
    shortlist: int | None = None,
    pairs: int | None = None,
    workers: int | None = None,
    world: str | None = None,
    loader: str | None = None,
) -> Config:
    """A configuration, that of a file or the standard one, with what is given in its place.

    Raises:
        InputError: if the file is wrong, or a loader is given for another world than nathlon's own.
    """
    if config is None:
        config = Config()
    elif not isinstance(config, Config):
        config = read_config(Path(config))
    if loader is not None:
        world = with_loader(config.world if world is None else world, loader)
    return _with(
        config,
        seed=seed,
        workers=workers,
        world=world,
        committee=_with(config.committee, shortlist=shortlist),
        tournament=_with(config.tournament, pairs=pairs),
    )


def _with(section: SectionT, **given: Any) -> SectionT:
    """A section with what is given, all but None, instead of its own."""
    return section.model_copy(update={name: value for name, value in given.items() if value is not None})


def entered(
    pool: Pool, found: Found, config: Config, on_opened: Callable[[int, int], None] = quietly
) -> tuple[EntryList, Config]:
    """Who enters of what was given and what is set aside, and the configuration for where they play.

    Raises:
        InputError: if one that was named cannot drive, or nobody can.
    """
    config = at_home(pool, found.sources, config)
    where = config.circuit, config.car, config.world
    entrants, refused = enter_found(pool, found, *where, on_opened)
    excluded = tuple(SetAside(printable(source), str(why), None) for source, why in refused.items())
    return EntryList(tuple(entrants), excluded=excluded), config


def at_home(pool: Pool, sources: list[str], config: Config) -> Config:
    """The configuration for where some sources play: in our simulator, what the first was trained on.

    Raises:
        InputError: if the world or a source cannot be opened.
    """
    check_world(pool, config.world)
    if not load_world(config.world).circuits:
        return config.suited
    circuit, car = trained_on(pool, sources)
    return config.model_copy(update={"circuit": circuit, "car": car})

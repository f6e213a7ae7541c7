"""`nathlon.recipes`: which way of training is better, over its seeds."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

import numpy as np
import polars as pl

from nathlon.api.selection import at_home, configured
from nathlon.arena.entrance import endings_of, enter_all
from nathlon.arena.pool import Pool
from nathlon.judge.recipes.grouping import attempts, checkpoints_of, recipe_folders, same_files
from nathlon.judge.recipes.scores import SEED, STAGE, score
from nathlon.judge.recipes.summary import summarise
from nathlon.reports.recipes_page import headline, write_recipes_page
from nathlon.results.recipes import void_units, write_recipes
from nathlon.selection.config import Config
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.single_run import single_run
from nathlon.sim.whole_file import check_output
from nathlon.terminal.progress import stage_progress, worker_count


class RecipesResult:
    """What recipes came to, and where it has left everything.

    Attributes:
        folder: of all that it has left: page, picture, `recipes.csv`, `scores.csv` and the store.
        recipes: one row a recipe: `nathlon.results.recipes.RECIPES`.
        scores: one row a checkpoint and task: `nathlon.results.recipes.SCORES`.
        remarks: sentences on what did not count or come again: void pairs, episodes, equal files.
    """

    def __init__(
        self, folder: Path, recipes: pl.DataFrame, scores: pl.DataFrame, remarks: Sequence[str] = ()
    ) -> None:
        self.folder, self.recipes, self.scores, self.remarks = folder, recipes, scores, tuple(remarks)

    def __repr__(self) -> str:
        told = headline(self.recipes), *self.remarks
        return "\n".join([*told, f"Report: {self.folder / 'index.html'}"])

    def _repr_html_(self) -> str:
        picture = base64.b64encode((self.folder / "recipes.png").read_bytes()).decode()
        return (
            f"<h3>{escape(headline(self.recipes))}</h3>"
            f'<img alt="recipes" src="data:image/png;base64,{picture}">' + self.recipes._repr_html_()
        )


def recipes(
    folders: str | Path | Iterable[str | Path],
    out: str | Path = "runs/recipes",
    *,
    config: Config | str | Path | None = None,
    pairs: int | None = None,
    seed: int | None = None,
    workers: int | None = None,
    world: str | None = None,
    progress: bool = True,
) -> RecipesResult:
    """Compare recipes, of which each has the training runs of some seeds in a folder.

    Every checkpoint races the anchors of the configuration in the format of its tournament. The same call
    goes on with what was stopped.

    Args:
        folders: one a recipe, which lends its name, or `NAME=FOLDER`; the first is the one to be better than.
        out: folder for everything that is left.
        config: whose anchors and tournament are raced, or the path of a `nathlon.toml`.
        pairs, seed, workers: instead of the configuration's.
        world: the simulator, instead of the configuration's.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if a folder holds no checkpoints, one cannot drive, or a name or file is wrong.
    """
    given = [folders] if isinstance(folders, str | Path) else folders
    found = recipe_folders(map(str, given))
    settings = configured(config, seed, pairs=pairs, workers=workers, world=world)
    check_output(Path(out))
    with Pool(worker_count(settings.workers)) as pool:
        files = checkpoints_of(found, endings_of(pool, settings.world))
        sources = [str(path) for paths in files.values() for path in paths]
        settings = at_home(pool, sources, settings)
        where = (settings.circuit, settings.car, settings.world)
        runs = attempts(pool, found, files, *where)
        references = enter_all(pool, settings.nightly.anchors, *where)
        raced = list({one.id: one for attempt in runs for one in attempt.checkpoints}.values())
        output = OutputFolder(Path(out))
        with (
            stage_progress(progress, (STAGE,)) as on_match,
            single_run(STAGE, [*raced, *references], settings, output.store, pool, on_match) as run,
        ):
            scores = score(run, runs, references, settings)
        table = summarise(scores, np.random.default_rng([settings.seed, SEED]))
        place = ", ".join(filter(None, where[:2])) or settings.world
        said = filter(None, [void_units(table, scores), run.otherwise])
        remarks = [*said, *same_files(runs, files, references)]
        with output.filling():
            write_recipes(table, scores, output.root)
            names = [one.name for one in references]
            write_recipes_page(table, scores, place, names, output.root, remarks)
    return RecipesResult(output.root, table, scores, remarks)

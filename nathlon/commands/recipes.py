"""`nathlon recipes`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nathlon.commands.options import (
    AsJson,
    ConfigPath,
    ConfigSeed,
    LoaderName,
    Out,
    Pairs,
    Workers,
    WorldName,
)
from nathlon.commands.selection import at_work
from nathlon.terminal import new_table, print_json, print_table, say

if TYPE_CHECKING:
    from nathlon.api.recipes import RecipesResult


def recipes(
    folders: Annotated[
        list[str],
        typer.Argument(
            help="Folders with the training runs of a recipe, or NAME=FOLDER; the first is the base."
        ),
    ],
    out: Out = Path("runs/recipes"),
    config: ConfigPath = None,
    pairs: Pairs = None,
    seed: ConfigSeed = None,
    workers: Workers = None,
    world: WorldName = None,
    loader: LoaderName = None,
    as_json: AsJson = False,
) -> None:
    """Say which way of training is better, over its seeds and not by its luckiest checkpoint.

    Exit code 0: done. 3: a checkpoint could not be judged, as most of its races are void.
    """
    from nathlon.judge.recipes.grouping import recipe_folders

    recipe_folders(folders)
    with at_work(f"The same command goes on from {out / 'store.sqlite'}."):
        import nathlon
        from nathlon.results.recipes import exit_code

        result = nathlon.recipes(
            folders,
            out,
            config=config,
            pairs=pairs,
            seed=seed,
            workers=workers,
            world=world,
            loader=loader,
            progress=not as_json,
        )
    if as_json:
        tables = {"recipes": result.recipes.to_dicts(), "scores": result.scores.to_dicts()}
        print_json({**tables, "remarks": list(result.remarks)})
    else:
        _print(result, out)
    sys.exit(exit_code(result.scores))


def _print(result: RecipesResult, out: Path) -> None:
    from nathlon.reports.recipes_page import CELLS, cells, headline

    heads = ("Recipe", "Runs", *(head for _, head, _ in CELLS), "Best", "Scored", "Expected")
    table = new_table("Ends of training runs", heads, ("Recipe", "Best"), lean=True)
    for row in result.recipes.to_dicts():
        best = ("", "", "")
        if row["best"] is not None:
            best = (row["best"], f"{row['best_points']:+.1f}", f"{row['best_expected']:+.1f}")
        table.add_row(row["recipe"], str(row["runs"]), *cells(row), *best)
    print_table(table)
    say(headline(result.recipes) + ".")
    for remark in result.remarks:
        say(remark)
    say(f"Page         {out / 'index.html'}")

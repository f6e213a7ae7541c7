"""`nathlon recipes`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nathlon.commands.options import AsJson, ConfigPath, ConfigSeed, Out, Pairs, Workers, WorldName
from nathlon.commands.selection import stoppable
from nathlon.terminal import new_table, print_json, print_table, say


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
    as_json: AsJson = False,
) -> None:
    """Say which way of training is better, over its seeds and not by its luckiest checkpoint."""
    from nathlon.recipe_comparison.grouping import recipe_folders

    recipe_folders(folders)
    from nathlon.arena.workers import start_server

    start_server()
    import nathlon
    from nathlon.reports.recipes_page import CELLS, cells, headline

    with stoppable(f"The same command goes on from {out / 'store.sqlite'}."):
        result = nathlon.recipes(
            folders,
            out,
            config=config,
            pairs=pairs,
            seed=seed,
            workers=workers,
            world=world,
            progress=not as_json,
        )
    if as_json:
        print_json({"recipes": result.recipes.to_dicts(), "scores": result.scores.to_dicts()})
        return
    table = new_table("Ends of training runs", lean=True)
    for column in ("Recipe", "Runs", *(head for _, head, _ in CELLS), "Best", "Scored", "Expected"):
        table.add_column(column, justify="left" if column in ("Recipe", "Best") else "right")
    for row in result.recipes.to_dicts():
        scored = (f"{row['best_points']:+.1f}", f"{row['best_expected']:+.1f}")
        table.add_row(row["recipe"], str(row["runs"]), *cells(row), row["best"], *scored)
    print_table(table)
    say(headline(result.recipes) + ".")
    say(f"Page         {out / 'index.html'}")

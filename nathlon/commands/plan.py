"""`nathlon plan`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nathlon.commands.options import AsJson, ConfigPath, Pairs, Workers, WorldName
from nathlon.results.words import stage_called
from nathlon.terminal import new_table, print_json, print_table, say


def plan(
    checkpoints: Annotated[
        list[str] | None, typer.Argument(help="Checkpoints; without any, what the next night would judge.")
    ] = None,
    config: ConfigPath = None,
    store: Annotated[
        str | None, typer.Option(help="Store of earlier selections, instead of the configuration's.")
    ] = None,
    pairs: Pairs = None,
    workers: Workers = None,
    world: WorldName = None,
    as_json: AsJson = False,
) -> None:
    """Say what a selection will cost and what it can find, before anything runs."""
    import nathlon
    from nathlon.results.forecast import sentences
    from nathlon.results.words import an_episode, episodes

    if not checkpoints and config is None:
        config = Path("nathlon.toml")
    told = nathlon.plan(
        checkpoints or None, config=config, pairs=pairs, workers=workers, world=world, store=store
    )
    if as_json:
        print_json(told.model_dump(mode="json"))
        return
    several = episodes(told.episode).capitalize()
    heads = ("Stage", "Entrants", several, "At most", "Core-hours")
    table = new_table("What is expected", heads, ("Stage",), lean=True)
    for stage in told.stages:
        if not stage.races:
            continue
        hours = "" if stage.core_s is None else f"{stage.core_s / 3600:.2f}"
        hours = "<0.01" if hours == "0.00" else hours
        table.add_row(
            stage_called(stage.name),
            f"{stage.entrants:,}",
            f"{stage.races:,}",
            f"{stage.most_races:,}",
            hours,
        )
    print_table(table)
    if told.budgets:
        found = ("Pairs of every two", several, f"Difference, points {an_episode(told.episode)}")
        table = new_table("What the round robin finds", found, lean=True)
        for budget in told.budgets:
            table.add_row(f"{budget.pairs:,}", f"{budget.races:,}", f"{budget.effect:.1f}")
        print_table(table)
    for sentence in sentences(told):
        say(sentence)

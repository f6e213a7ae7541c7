"""`nathlon league`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nathlon.commands.options import AsJson, Out, Workers
from nathlon.commands.selection import at_work, print_places, print_verdict
from nathlon.results.words import figure
from nathlon.sim.extras import need
from nathlon.terminal import new_table, print_json, print_table, say, warn

if TYPE_CHECKING:
    from nathlon.lab.league.generation import Generation


def league(
    config: Annotated[Path, typer.Argument(help="The file of the league (.toml).")],
    out: Out = Path("runs/league"),
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Polish policies among their own kind, generation after generation, until they are clean.

    The same command goes on after Ctrl-C, and with more generations from the last one.
    """
    need("torch", "train", "a league")
    with at_work("The same command goes on."):
        from nathlon import league as run_league

        result = run_league(config, out, workers=workers, progress=not as_json)
    generations = [made.model_dump(mode="json") for made in result.generations]
    if as_json:
        print_json({"reached": result.reached, "best": result.best, "generations": generations})
        return
    _print_generations(result.generations)
    if result.selection.selection is None:
        say(repr(result.selection))
    else:
        print_verdict(result.selection.summary)
        print_places(result.selection)
    say(f"Generations  {out / 'generations.csv'}")
    say(f"Best         {result.best}")
    if not result.reached:
        warn("The league ended before it came to what it is for.")


def _print_generations(generations: list[Generation]) -> None:
    """Who went on from each generation, with 95 % intervals."""
    heads = ("Generation", "Entrant", "Points a race", "Contacts per km", "At fault per km", "Penalties")
    shown = new_table("Who went on, with 95 % intervals", heads)
    for made in generations:
        best = made.member(made.parent)
        shown.add_row(
            str(made.number),
            best.name,
            figure(best.points_per_race, best.points_low, best.points_high),
            figure(best.contacts_per_km, best.contacts_low, best.contacts_high, ".3f"),
            figure(best.at_fault_per_km, best.at_fault_low, best.at_fault_high, ".3f"),
            f"{best.penalties:.2f}",
        )
    print_table(shown)

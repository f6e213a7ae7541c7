"""`nathlon stints`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nathlon.commands.options import AsJson, CarName, Circuit, Out, Seed, Workers
from nathlon.commands.selection import at_work
from nathlon.policies.sources.finding import check_given
from nathlon.terminal import new_table, print_json, print_table, say


def stints(
    policy: Annotated[str, typer.Argument(help="Checkpoint, driver:pace=0.95 or plugin:NAME.")],
    scenario: Annotated[
        str, typer.Option(help="Race on tyres that wear, with settings if you like: NAME:laps=20.")
    ] = "grand_prix_stops",
    circuit: Circuit = "lindenring",
    car: CarName = "gt3",
    compounds: Annotated[
        str, typer.Option(metavar="NAME,NAME", help="Compounds to choose among.")
    ] = "racing-soft,racing-medium,racing-hard",
    runs: Annotated[int, typer.Option(min=2, help="Practice runs on each compound.")] = 2,
    stops: Annotated[int, typer.Option(min=0, max=20, help="Stops of a plan, at most.")] = 4,
    seed: Seed = 1,
    workers: Workers = None,
    out: Out = Path("runs/stints"),
    as_json: AsJson = False,
) -> None:
    """Find out when a policy should stop for tyres and fuel, and write the plans as entrants."""
    check_given([policy])
    with at_work("Practice begins anew the next time."):
        import nathlon

        result = nathlon.stints(
            policy,
            scenario=scenario,
            circuit=circuit,
            car=car,
            compounds=compounds.split(","),
            runs=runs,
            stops=stops,
            seed=seed,
            workers=workers,
            out=out,
            progress=not as_json,
        )
    if as_json:
        print_json(result.table.to_dicts())
        return
    heads = ("Stops", "Stints", "Expected s", "Behind s")
    table = new_table(f"{scenario} on {circuit}, alone on the road", heads, ("Stints",))
    for row in result.table.iter_rows(named=True):
        behind = (
            f"{row['behind_s']:.1f} ({row['low_s']:.1f} to {row['high_s']:.1f})" if row["behind_s"] else ""
        )
        table.add_row(str(row["stops"]), row["stints"], f"{row['expected_s']:.1f}", behind)
    print_table(table)
    say(f"Plans        {out}")

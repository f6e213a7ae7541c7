"""`nathlon world`: which simulators there are, and whether one can be selected in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from nathlon.commands.options import AsJson
from nathlon.terminal import print_json, say, warn

if TYPE_CHECKING:
    from nathlon.arena.world import Setup
    from nathlon.arena.worlds.rehearsal import RehearsalReport

WorldName = Annotated[
    str, typer.Argument(metavar="WORLD", help="MODULE:NAME, PATH.py:NAME, or a name that a package offers.")
]


def list_worlds(as_json: AsJson = False) -> None:
    """List the worlds that are known by name; none is loaded."""
    from importlib.metadata import entry_points

    from nathlon.arena.world_finding import RACING, WORLDS

    found = [{"name": RACING, "from": "nathlon"}]
    found += [{"name": one.name, "from": one.value} for one in sorted(entry_points(group=WORLDS))]
    if as_json:
        print_json(found)
        return
    for world in found:
        say(f"{world['name']:<20} {world['from']}")


def check_world(world: WorldName, as_json: AsJson = False) -> None:
    """Try a world out, and say what a selection in it can tell; exits with 2 if it cannot be used."""
    from nathlon.arena.pool import Pool
    from nathlon.arena.worlds.rehearsal import PATIENCE_S, rehearse

    with Pool(1, first_answer_s=PATIENCE_S) as pool:
        report = rehearse(pool, world)
    told = [] if report.faults else what_it_tells(report)
    if as_json:
        _print_report(report, told)
    else:
        for finding in report.findings:
            if not finding.fault:
                say(f"{finding.scenario}: {'Warning: ' if finding.warning else ''}{finding.says}")
        for sentence in told:
            say(sentence)
        for finding in report.faults:
            warn(f"nathlon: {finding.says}")
    if report.faults:
        raise typer.Exit(2)


def _print_report(report: RehearsalReport, told: list[str]) -> None:
    print_json(
        {
            "world": report.world,
            "usable": not report.faults,
            "scenarios": [
                {
                    "name": tried.name,
                    "seats": tried.setup.seats,
                    "sides": [[tried.setup.seats[seat] for seat in side] for side in tried.setup.sides],
                    "roles": list(dict.fromkeys(filter(None, tried.setup.roles))),
                    "points": tried.setup.points,
                    "episode_s": tried.episode_s,
                }
                for tried in report.scenarios
            ],
            "measures": {name: measure._asdict() for name, measure in report.measures.items()},
            "findings": [
                {
                    "scenario": finding.scenario,
                    "fault": finding.fault,
                    "warning": finding.warning,
                    "says": finding.says,
                }
                for finding in report.findings
            ],
            "tells": told,
        }
    )


def what_it_tells(report: RehearsalReport) -> list[str]:
    """In plain words, what a selection in a world can tell and what it cannot."""
    told = [_meetings(tried.name, tried.setup) for tried in report.scenarios]
    if all(len(tried.setup.sides) < 2 for tried in report.scenarios):
        told.append("No sides meet, so that there is no round robin: the n-athlon ranks.")
    if report.measures:
        ways = {"min": "less", "max": "more"}
        measures = ", ".join(
            f"{name} ({measure.unit}, {ways[measure.goal]} is better)"
            for name, measure in report.measures.items()
        )
        told.append(f"Besides the score are measured: {measures}. The filter keeps every trade-off of them.")
    else:
        told.append(
            "Nothing but the score is measured: no trade-off shows, the filter keeps who scores most."
        )
    if "distance_m" in report.measures and "contacts" not in report.measures:
        told.append("Contacts are not measured: no gate bars anybody for them.")
    return told


def _meetings(name: str, setup: Setup) -> str:
    points = (
        "points are by place (10 8 6 5 4 3 2 1), so that it does not count by how much somebody wins"
        if setup.points == "place"
        else "points are the score"
    )
    match len(setup.sides):
        case 1:
            how = "one side, so that entrants are compared by what they reach alone"
        case 2:
            how = "two sides, so that every two entrants meet, and change sides"
        case count:
            how = f"{count} sides, so that all entrants meet, each on every side"
    others = (
        f"; the baseline has {', '.join(setup.seats[seat] for seat in sorted(setup.free))}"
        if setup.free
        else ""
    )
    roles = ", ".join(dict.fromkeys(filter(None, setup.roles)))
    kinds = f"; an entrant has a policy for each role ({roles})" if roles else ""
    return f"{name}: {how}{kinds}; {points}{others}."

"""Nights and gates, told to the sinks of a configuration."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from nathlon.arena.decision import Decision
from nathlon.lab.sinks.bulletin import PICTURE, Bulletin, Promotion, place
from nathlon.lab.sinks.delivery import CHAMPION, TRACKERS, Delivery, deliver
from nathlon.policies.sources import is_path
from nathlon.policies.sources.identity import is_still
from nathlon.reports.picture import ranking_picture
from nathlon.reports.verdict import verdict
from nathlon.results.gate import GateReport
from nathlon.results.selection import Selection
from nathlon.selection.config import Config
from nathlon.selection.nightly.night import Night
from nathlon.sim.whole_file import whole_file


def tell_night(night: Night, config: Config) -> tuple[Delivery, ...]:
    """Deliver a night to every sink that the configuration names, unless another process does.

    Nothing is delivered where there is nothing to tell.
    """
    if night.told_elsewhere or not night.counts:
        return ()
    sinks = config.results.sinks
    if night.selection is None:
        sinks = {name: address for name, address in sinks.items() if name not in TRACKERS}
    try:
        told = bulletin(night, config)
    except OSError as error:  # no room for the picture
        return tuple(Delivery(sink, None, str(error.strerror)) for sink in sinks)
    return deliver(told, sinks)


def tell_gate(report: GateReport, given: Iterable[str], config: Config) -> tuple[Delivery, ...]:
    """Have the registry say who has passed a gate alone.

    Args:
        report: what the gate says.
        given: sources of the candidates.
        config: whose sinks they are.
    """
    if config.results.mlflow is None or report.verdict != Decision.PASS or len(report.candidates) != 1:
        return ()
    [passed] = report.candidates
    files = [source for source in given if is_path(source) and is_still(source, passed.entrant)]
    if not files:
        return (Delivery(CHAMPION, None, f"{passed.name} is no file, or has changed since it was judged"),)
    told = Promotion(
        place=place(report.circuit, report.car, report.world),
        entrant=passed.entrant,
        name=passed.name,
        source=Path(files[0]),
    )
    return deliver(told, {CHAMPION: config.results.mlflow})


def bulletin(night: Night, config: Config) -> Bulletin:
    """What there is to tell of a night; its picture is drawn into its folder."""
    if night.selection is None or night.name is None:
        return Bulletin(night=night.name, code=night.code, reason=night.reason, headline=night.reason)
    folder = Path(config.out) / night.name
    _draw(night.selection, folder / PICTURE)
    told, summary = verdict(night.selection), night.selection.summary
    served = config.results.link and f"{config.results.link.rstrip('/')}/{night.name}"
    return Bulletin(
        night=night.name,
        code=night.code,
        reason=night.reason,
        headline=told.headline,
        sentences=told.sentences,
        circuit=summary.circuit,
        car=summary.car,
        world=summary.world,
        sent=summary.sent,
        ranking=summary.ranking,
        report=served and f"{served}/{summary.report}",
        picture=served and f"{served}/{PICTURE}",
        folder=folder,
    )


def _draw(selection: Selection, path: Path) -> None:
    ranking = selection.named("ranking")
    summary = selection.summary
    heading = summary.a_mean if ranking["mean"].is_not_null().any() else f"Points {summary.an_episode}"
    with whole_file(path) as partial:
        partial.write_bytes(ranking_picture(ranking, heading))

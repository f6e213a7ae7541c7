"""What the stages of a selection answered, and the summary that they make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import polars as pl

from nathlon.arena.entrant import Entrant
from nathlon.arena.results import POLICY_FAULTS, STRATEGIES, VOID_ENDINGS
from nathlon.arena.voids import NotJudged
from nathlon.arena.world import World
from nathlon.arena.world_registry import load_world
from nathlon.results.forecast import Forecast
from nathlon.results.standing import ActionTime, Crossed, ranked
from nathlon.results.summary import Sent, SetAside, Summary, TestMarks, versions
from nathlon.results.voided import most_voided, voided
from nathlon.selection.battery import BatteryAnswer
from nathlon.selection.committee.decision import CommitteeDecision
from nathlon.selection.config import Config
from nathlon.selection.field import EntryList
from nathlon.selection.forecasting import effect
from nathlon.selection.pareto import lost_remark
from nathlon.selection.round_robin import RoundRobinAnswer
from nathlon.selection.run import CONFIDENCE, Answer, Run
from nathlon.sim.names import printable
from nathlon.tournament.points import pair_correlation
from nathlon.tournament.power import unit_deviation

GONE = "is gone or has changed since the selection began, so it could not be sent"
ALIKE = (
    "All mirrored pairs of the same two came out alike, so the intervals know of no chance. Where seeds have "
    "no effect (nathlon world check) they say nothing of other episodes."
)
ALIKE_DEVIATION = 1e-9
"""Points a race: what adding up in another order may leave of none."""


@dataclass(frozen=True)
class StageAnswers:
    """What the stages of a selection answered.

    Attributes:
        expected: before it began.
        filtered, tested, raced: of the filter, the n-athlon and the tournament.
        set_aside: stages that were not held, and why.
        times: what an action of each finalist costs.
        gone: finalists that could not be sent.
        decision: of the committee, on whom to send.
    """

    expected: Forecast
    filtered: Answer
    tested: BatteryAnswer
    raced: Answer
    set_aside: Mapping[str, str]
    times: Sequence[ActionTime]
    gone: Sequence[Entrant]
    decision: CommitteeDecision

    @property
    def not_judged(self) -> list[NotJudged]:
        """Who could not be judged in one of the stages."""
        stages = self.filtered, self.tested, self.raced
        return list(dict.fromkeys(one for stage in stages for one in stage.not_judged))

    @property
    def deviation(self) -> float | None:
        """Of two entrants' difference from one unit to the next, points a race; None where too few tell."""
        return None if "tournament" in self.set_aside else unit_deviation(self.raced.results)


def summarise(run: Run, field: EntryList, config: Config, answers: StageAnswers) -> Summary:
    """What a selection came to, still without replays."""
    tested, raced, deviation = answers.tested, answers.raced, answers.deviation
    ranking, references = raced.tables["ranking"], len(field.anchors)
    world = load_world(config.world)
    results = run.store.results_of_run(run.name)
    endings = results["ending"]
    names = {entrant.id: entrant.name for entrant in field.entrants}
    crossed = raced.tables.get("strategies", pl.DataFrame(schema=STRATEGIES))
    return Summary(
        stages=tuple(run.stages),
        ranking=ranked(ranking, names, raced.records if isinstance(raced, RoundRobinAnswer) else None),
        sent=tuple(Sent(name=names[entrant], entrant=entrant) for entrant in answers.decision.chosen),
        seed=config.seed,
        world=config.world,
        episode=world.episode,
        brings="score" if _by_score(world) else "points",
        circuit=config.circuit,
        car=config.car,
        versions=versions(),
        pair_correlation=pair_correlation(raced.results),
        unit_deviation=deviation,
        effect=None
        if deviation is None
        else effect(config, ranking.height - references, references, deviation),
        forecast=answers.expected,
        confidence=CONFIDENCE,
        marks={
            test: TestMarks(
                base=marks.base,
                reference=marks.reference,
                asks=tested.asked[test],
                stretch_m=tested.stretches[test],
                failed=tested.failed[test],
            )
            for test, marks in tested.marks.items()
        },
        tests_set_aside=tested.set_aside,
        car_runs=len(endings),
        faults=int(endings.is_in(POLICY_FAULTS).sum()),
        void=int(endings.is_in(VOID_ENDINGS).sum()),
        not_judged=voided(answers.not_judged, names),
        most_void=most_voided(results, names),
        excluded=field.without(run.gone).excluded,
        gone=tuple(
            SetAside(source=printable(each.source), reason=GONE, digest=each.id) for each in answers.gone
        ),
        notes=remarks(field, deviation, run.otherwise, lost_remark(answers.filtered.tables["pareto"])),
        also={
            entrant.name: tuple(map(printable, entrant.also)) for entrant in field.entrants if entrant.also
        },
        stages_set_aside=dict(answers.set_aside),
        strategies=tuple(Crossed(**row) for row in crossed.to_dicts()),
        action_times=tuple(answers.times),
    )


def remarks(
    field: EntryList, deviation: float | None, otherwise: str = "", lost: str = ""
) -> tuple[str, ...]:
    """What is said of a run beside its verdict.

    Args:
        field: who took part.
        deviation: of a matchup's difference from unit to unit; None where nobody met twice.
        otherwise: what came otherwise when it was played again; '' where nothing did.
        lost: what the filter may have left aside; '' where that is little.
    """
    alike = ALIKE if deviation is not None and deviation < ALIKE_DEVIATION else ""
    return (*field.notes, *filter(None, (alike, otherwise, lost)))


def _by_score(world: World) -> bool:
    return not world.circuits and all(world.setup(name).points == "score" for name in world.scenarios)

"""The loop: proposed, thrown out or aligned, trained, compared, bred; and one last long training."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from nathlon.lab.reward.alignment import Alignment, Preference, align
from nathlon.lab.reward.candidates import Brief, Candidate, CandidateOutcome, Proposal, Proposer
from nathlon.lab.reward.clips import Clips, Studio
from nathlon.lab.reward.judging import ClipPair, ClipQuestion, Judge
from nathlon.lab.reward.library import DRIVER, library
from nathlon.lab.reward.measures import mean, measure
from nathlon.lab.reward.ranking import all_pairs, some_pairs, strengths
from nathlon.lab.reward.records import (
    CANDIDATES,
    JUDGED,
    OUTCOMES,
    JudgedClips,
    ranked,
    read_record,
    write_paper,
)
from nathlon.lab.reward.settings import DesignSettings
from nathlon.lab.reward.trying import Tried, look, train
from nathlon.lab.reward.vetting import vet
from nathlon.policies.training.log import Status
from nathlon.policies.training.trainer import Diverged
from nathlon.results.words import percent
from nathlon.sim.errors import InputError

SETTINGS = "design.json"
LIBRARY, FINAL = "library", "final"
PROPOSED, PREFERRED, CAME_OF_IT = "candidates.json", "preferences.json", "outcomes.json"
ATTEMPTS = 3
"""How often formulas are asked for in a round, until there are as many as wanted."""
FINALLY = "final"
"""Name of the winner after its last training."""
MOST_REMARKS = 20

_SETTINGS = TypeAdapter(DesignSettings)
_OUTCOME = TypeAdapter(CandidateOutcome)


class Design:
    """A design in a folder, from wherever it stopped.

    Attributes:
        folder: keeps all of it.
        settings: what it is made of.
        studio: where clips are made.
        clips: of the library and of all trained so far, by driver.
        preferences: all so far.
        rounds: candidates of each round so far.
        outcomes: of each round that is over, the best first.
        final: what the winner comes to after its last training; None before.
    """

    def __init__(self, folder: Path, settings: DesignSettings) -> None:
        """A design; what the folder keeps is read as the steps come to it.

        Raises:
            InputError: if the folder holds another design, or cannot be written.
        """
        self.folder, self.settings = folder, settings
        path = folder / SETTINGS
        if path.exists():
            _compare(path, read_record(path, _SETTINGS), settings)
        else:
            write_paper(path, _SETTINGS, settings)
        training = settings.training
        self.studio = Studio(training.circuit, training.car, settings.starts)
        self.clips: dict[str, Clips] = {}
        self.preferences: list[Preference] = []
        self.rounds: list[tuple[Candidate, ...]] = []
        self.outcomes: list[tuple[CandidateOutcome, ...]] = []
        self.final: CandidateOutcome | None = None

    @property
    def updates(self) -> int:
        """Of all trainings, if every round has enough candidates and none fails."""
        settings = self.settings
        tried = settings.run("progress / m", settings.updates).updates
        last = settings.run("progress / m", settings.final_updates).updates
        return settings.rounds * settings.kept * tried + last

    def run(
        self,
        proposer: Proposer,
        judge: Judge,
        on_progress: Callable[[int, str], None],
        on_round: Callable[[], None],
    ) -> None:
        """Go on to the end, or until Ctrl-C; every step is kept.

        Args:
            proposer: proposes formulas.
            judge: compares clips.
            on_progress: told how many updates are done, and what goes on.
            on_round: told that there is more to report.

        Raises:
            InputError: if no formula can be used, a model cannot be asked, or the folder is damaged.
        """
        self._tell, self._done = on_progress, 0
        self._look_at_library(judge)
        for number in range(1, self.settings.rounds + 1):
            self._propose(number, proposer)
            self._train(number)
            self._judge(number, judge)
            on_round()
        self._finish()
        on_round()

    @property
    def best(self) -> tuple[CandidateOutcome, ...]:
        """Of the last round, the best so far among them, the best first."""
        return self.outcomes[-1] if self.outcomes else ()

    def _look_at_library(self, judge: Judge) -> None:
        settings = self.settings

        def on_clip(done: int, count: int) -> None:
            self._tell(0, f"library: {done} of {count} drivers")

        self.clips |= library(self.studio, self.folder / LIBRARY, settings.seed, on_clip)
        self.library = dict(self.clips)
        pairs = some_pairs(self.clips, settings.preferences, np.random.default_rng([settings.seed, 3]))
        self._ask(LIBRARY, self.folder / LIBRARY / PREFERRED, pairs, judge)

    def _ask(self, label: str, path: Path, pairs: list[ClipPair], judge: Judge) -> None:
        """Have pairs judged that have not been, and take in all preferences."""
        judged = read_record(path, JUDGED) if path.exists() else JudgedClips()
        got = list(judged.preferences)
        if not judged.over:
            known = {(one.first, one.second, one.start) for one in got}
            left = [pair for pair in pairs if tuple(pair) not in known]
            self._tell(self._done, f"{label}: {len(left)} comparisons")

            def on_preference(one: Preference) -> None:
                got.append(one)
                if self.settings.judge != "rule":
                    write_paper(path, JUDGED, JudgedClips(preferences=tuple(got)))

            if left:
                judge.judge(
                    ClipQuestion(label, self.settings.task, self.clips, self.clips[DRIVER], left),
                    on_preference,
                )
            write_paper(path, JUDGED, JudgedClips(over=True, preferences=tuple(got)))
        self.preferences += got

    def _place(self, number: int) -> Path:
        return self.folder / f"round-{number}"

    def _propose(self, number: int, proposer: Proposer) -> None:
        path = self._place(number) / PROPOSED
        if not path.exists():
            self._tell(self._done, f"round {number}: formulas")
            write_paper(path, CANDIDATES, self._chosen(self._candidates(number, proposer)))
        self.rounds.append(read_record(path, CANDIDATES))

    def _candidates(self, number: int, proposer: Proposer) -> list[Candidate]:
        """As many as wanted that are fit, and those that were thrown out on the way."""
        settings = self.settings
        found: list[Candidate] = []
        tried_before = {one.formula for before in self.rounds for one in before if one.kept}
        for attempt in range(ATTEMPTS):
            missing = settings.candidates - sum(not one.refused for one in found)
            if not missing:
                break
            refused = tuple((one.formula, one.refused) for one in found if one.refused)
            brief = Brief(settings.task, number, attempt, missing, self.best, tuple(self._remarks()), refused)
            for proposal in proposer.propose(brief):
                known = tried_before | {one.formula for one in found}
                found.append(self._vetted(f"{number}.{len(found) + 1}", proposal, known))
        if all(one.refused for one in found):
            last = f": {found[-1].formula}: {found[-1].refused}" if found else ""
            raise InputError(f"round {number}: none of {len(found)} formulas is fit{last}")
        return found

    def _remarks(self) -> list[str]:
        """What people and models have said of the last round, the latest last; rules say nothing new."""
        if self.settings.judge == "rule":
            return []
        path = (
            self._place(len(self.outcomes)) / PREFERRED
            if self.outcomes
            else self.folder / LIBRARY / PREFERRED
        )
        told = [one for one in read_record(path, JUDGED).preferences if one.remark]
        sides = {1: "{0} is better than {1}", -1: "{1} is better than {0}", 0: "{0} and {1} are alike"}
        return [
            f"{sides[one.better].format(one.first, one.second)}: {one.remark}" for one in told[-MOST_REMARKS:]
        ]

    def _vetted(self, name: str, proposal: Proposal, known: set[str]) -> Candidate:
        facts = proposal.model_dump()
        try:
            vetted = vet(
                proposal.formula, self.library, self.settings.training.qrsac.gamma, self.studio.step_s
            )
        except InputError as error:
            return Candidate(**facts, name=name, refused=str(error))
        facts["formula"] = vetted.expression.text
        if facts["formula"] in known:
            return Candidate(**facts, name=name, refused="has been proposed before")
        alignment = align(vetted.expression, self.clips, self.preferences)
        return Candidate(**facts, name=name, factor=vetted.factor, alignment=alignment)

    def _chosen(self, found: list[Candidate]) -> tuple[Candidate, ...]:
        """The candidates, those marked as kept that agree best with the preferences."""
        fit = [one for one in found if one.alignment is not None]
        best = sorted(fit, key=lambda one: -_tac(one.alignment))[: self.settings.kept]
        names = {one.name for one in best}
        return tuple(one.model_copy(update={"kept": one.name in names}) for one in found)

    def _train(self, number: int) -> None:
        """Train those kept, one after the other; who fails is noted."""
        candidates = list(self.rounds[-1])
        for index, one in enumerate(candidates):
            if not one.kept or one.failed:
                continue
            config = self.settings.run(one.scaled, self.settings.updates)
            try:
                train(
                    self._folder_of(one.name), config, self.settings.seed, partial(self._on_status, one.name)
                )
            except Diverged as error:
                candidates[index] = one.model_copy(update={"failed": str(error).partition(": ")[2]})
                write_paper(self._place(number) / PROPOSED, CANDIDATES, tuple(candidates))
            self._done += config.updates
        self.rounds[-1] = tuple(candidates)

    def _folder_of(self, name: str) -> Path:
        return self._place(int(name.partition(".")[0])) / name

    def _on_status(self, name: str, status: Status) -> None:
        lap = "no lap yet" if math.isnan(status.lap_s) else f"lap {status.lap_s:.1f} s"
        self._tell(
            self._done + status.updates, f"{name}: {lap}, {percent(status.off_course_share, 1)} off course"
        )

    def _judge(self, number: int, judge: Judge) -> None:
        """Compare those trained with each other and with the best so far."""
        tried = {one.name: self._look(one.name) for one in self.rounds[-1] if one.kept and not one.failed}
        if not tried and not self.best:
            raise InputError(f"round {number}: no training has come to its end, expected one that does")
        champion = self.best[:1]
        names = [*tried, *(one.candidate.name for one in champion)]
        settings = self.settings
        pairs = all_pairs(
            names, settings.starts, settings.each, np.random.default_rng([settings.seed, 4, number])
        )
        path = self._place(number)
        self._ask(f"round-{number}", path / PREFERRED, pairs, judge)
        judged = read_record(path / PREFERRED, JUDGED).preferences
        strength = strengths(names, judged)
        candidates = {one.name: one for one in self.rounds[-1]}
        found = [self._outcome(candidates[name], strength[name], one) for name, one in tried.items()]
        found += [one.model_copy(update={"strength": strength[one.candidate.name]}) for one in champion]
        write_paper(path / CAME_OF_IT, OUTCOMES, ranked(found))
        self.outcomes.append(ranked(found))

    def _look(self, name: str) -> Tried:
        self._tell(self._done, f"{name}: clips")
        tried = look(self._folder_of(name), name, self.studio)
        self.clips[name] = tried.clips
        return tried

    def _outcome(self, candidate: Candidate, strength: float, tried: Tried) -> CandidateOutcome:
        return CandidateOutcome(
            candidate=candidate,
            strength=strength,
            measured=mean(measure(tried.clips, self.clips[DRIVER], self.studio.step_s)),
            lap_s=tried.lap_s,
            lap_off_course=tried.lap_off_course,
            checkpoint=tried.checkpoint.relative_to(self.folder).as_posix(),
        )

    def _finish(self) -> None:
        """Train the winner for long."""
        winner, folder = self.best[0], self.folder / FINAL
        config = self.settings.run(winner.candidate.scaled, self.settings.final_updates)
        train(folder, config, self.settings.seed, partial(self._on_status, FINALLY))
        tried = look(folder, FINALLY, self.studio)
        self.clips[FINALLY] = tried.clips
        self.final = self._outcome(winner.candidate, winner.strength, tried)
        write_paper(folder / CAME_OF_IT, _OUTCOME, self.final)
        self._tell(self.updates, f"{winner.candidate.name} wins")


def _tac(alignment: Alignment | None) -> float:
    assert alignment is not None, "it was not refused"
    return alignment.tac


def _compare(path: Path, found: DesignSettings, wanted: DesignSettings) -> None:
    for name in DesignSettings.model_fields:
        if getattr(found, name) != getattr(wanted, name):
            raise InputError(f"{path}: of another design, which differs in {name}; choose another folder")

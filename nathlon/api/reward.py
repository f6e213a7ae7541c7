"""`nathlon.design_reward`: a reward from words, by the published loop."""

from __future__ import annotations

import logging
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Literal

import torch

from nathlon.lab.llm.chat import Endpoint
from nathlon.lab.llm.transcripts import Transcripts
from nathlon.lab.reward.candidates import CandidateOutcome, Proposer
from nathlon.lab.reward.design import Design
from nathlon.lab.reward.drawing import drawing
from nathlon.lab.reward.judging import Judge, JudgingOnlooker, JudgingRule
from nathlon.lab.reward.measures import RULE
from nathlon.lab.reward.sampling import Sampler
from nathlon.lab.reward.settings import DesignSettings
from nathlon.lab.reward.wording import Model
from nathlon.policies.training.config import CONFIGS, read_config
from nathlon.reports.reward_page import write_reward_page
from nathlon.sim.data_file import checked, find_data
from nathlon.sim.folder_lock import sole_user
from nathlon.terminal.progress import progress_bars

PAGE, TRANSCRIPTS = "index.html", "transcripts"


class RewardDesign:
    """A design that has come to its end.

    Attributes:
        folder: keeps all of it.
        winner: what came of the best formula in its last training, a
            `nathlon.lab.reward.candidates.CandidateOutcome`.
        formula: that of its training, for `[reward] expression` of training configurations.
        checkpoint: its last one.
        page: every candidate with its curve, clips and comparisons (.html).
    """

    def __init__(self, folder: Path, winner: CandidateOutcome) -> None:
        self.folder, self.winner = folder, winner
        self.formula = winner.candidate.scaled
        self.checkpoint, self.page = folder / winner.checkpoint, folder / PAGE

    def __repr__(self) -> str:
        lap = "no lap completed" if self.winner.lap_s is None else f"lap {self.winner.lap_s:.3f} s"
        return f"{self.winner.candidate.name} wins, {lap}: {self.formula}"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"


def design_reward(
    task: str,
    out: str | Path = "runs/reward",
    *,
    config: str | Path = "design",
    proposer: Literal["embedded", "model"] = "embedded",
    judge: Literal["rule", "people", "model"] = "rule",
    rule: str = RULE,
    rounds: int = 4,
    candidates: int = 10,
    kept: int = 5,
    updates: int = 8000,
    final_updates: int = 40000,
    starts: int = 8,
    preferences: int = 100,
    each: int | None = None,
    transcripts: str | Path | None = None,
    seed: int = 1,
    threads: int = 1,
    port: int = 0,
    progress: bool = True,
) -> RewardDesign:
    """Design a reward, to the end or until Ctrl-C; the same call goes on.

    Args:
        task: what is wanted, in words; read by people and models.
        out: folder for all of it.
        config: shipped name or path of a training configuration: circuit, car, rollouts and networks.
        proposer: `embedded` puts formulas together and breeds them, `model` asks a language model.
        judge: `rule` goes by what is measured, `people` are asked in a browser on this machine, `model` asks
            one that sees pictures, which `NATHLON_JUDGE` may name apart.
        rule: an expression of what is measured.
        rounds, candidates, kept: of formulas: rounds, those proposed in each, those trained of these.
        updates, final_updates: of a candidate's training, and of the winner's last.
        starts: clips of everybody.
        preferences: between clips of known drivers, before the first round.
        each: clips in which two candidates are compared; all by a rule, else 1.
        transcripts: folder of another run's, whose answers are given again instead of a model's.
        seed: of all randomness.
        threads: of the learner.
        port: of the page for people, 0 for any that is free.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if a setting is wrong, the folder holds another design or is in use, no formula can be
            used, or a model cannot be asked.
        KeyboardInterrupt: after Ctrl-C, once the state is kept.
    """
    logging.basicConfig(format="%(message)s")
    folder = Path(out)
    settings = checked(
        {
            "task": task,
            "training": read_config(find_data(str(config), "training configuration", CONFIGS)),
            "proposer": proposer,
            "judge": judge,
            "rule": rule,
            "rounds": rounds,
            "candidates": candidates,
            "kept": kept,
            "updates": updates,
            "final_updates": final_updates,
            "starts": starts,
            "preferences": preferences,
            "each": each or (starts if judge == "rule" else 1),
            "seed": seed,
        },
        DesignSettings,
        "the design",
    )
    proposed, judged = _transcripts(settings, folder, transcripts)
    torch.set_num_threads(threads)
    with sole_user(folder), progress_bars(progress) as bars:
        design = Design(folder, settings)
        if not (folder / TRANSCRIPTS).exists():
            for endpoint in {said.endpoint for said in (proposed, judged) if said and said.endpoint}:
                endpoint.check()
        task_id = bars.add_task("updates", total=design.updates, note="")

        def on_progress(done: int, note: str) -> None:
            bars.update(task_id, completed=done, note=note)

        def on_round() -> None:
            write_reward_page(drawing(design), folder / PAGE)

        design.run(
            _proposer(settings, proposed), _judge(settings, design, judged, port), on_progress, on_round
        )
    assert design.final is not None, "it has come to its end"
    return RewardDesign(folder.absolute(), design.final)


def _transcripts(
    settings: DesignSettings, folder: Path, earlier: str | Path | None
) -> tuple[Transcripts | None, Transcripts | None]:
    """By which the proposer and the judge are asked, for what is a model."""

    def asked(role: str, endpoint: Callable[[], Endpoint]) -> Transcripts | None:
        if role != "model":
            return None
        if earlier is not None:
            return Transcripts(folder / TRANSCRIPTS, None, Path(earlier))
        return Transcripts(folder / TRANSCRIPTS, endpoint())

    return (
        asked(settings.proposer, Endpoint.from_environment),
        asked(settings.judge, Endpoint.judge_from_environment),
    )


def _proposer(settings: DesignSettings, said: Transcripts | None) -> Proposer:
    if settings.proposer == "model":
        assert said is not None, "there is a model"
        return Model(said)
    return Sampler(settings.seed)


def _judge(settings: DesignSettings, design: Design, said: Transcripts | None, port: int) -> Judge:
    if settings.judge == "rule":
        return JudgingRule(settings.rule, design.studio.step_s)
    if settings.judge == "model":
        assert said is not None, "there is a model"
        return JudgingOnlooker(said, design.studio)
    from nathlon.lab.reward.people import People  # needs an extra

    return People(design.studio, port)

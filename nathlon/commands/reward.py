"""`nathlon reward`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from nathlon.commands.options import AsJson, Out, Seed
from nathlon.commands.selection import stoppable
from nathlon.selection.bounds import MOST_WORKERS
from nathlon.sim.extras import need
from nathlon.terminal import print_json, say

Proposer = Literal["embedded", "model"]
Judge = Literal["rule", "people", "model"]


def design_reward(
    task: Annotated[str, typer.Argument(help="What the reward should bring about, in words.")],
    out: Out = Path("runs/reward"),
    config: Annotated[
        str, typer.Option(help="Training configuration: circuit, car, races, networks; name or path.")
    ] = "design",
    proposer: Annotated[
        Proposer, typer.Option(help="embedded, or a language model: NATHLON_MODEL_URL, NATHLON_MODEL.")
    ] = "embedded",
    judge: Annotated[
        Judge,
        typer.Option(
            help="rule, people in a browser, or a language model that sees pictures: NATHLON_JUDGE."
        ),
    ] = "rule",
    rule: Annotated[
        str | None, typer.Option(help="Expression by which measured clips are judged; more is better.")
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, max=100, help="Number of rounds.")] = 4,
    candidates: Annotated[int, typer.Option(min=1, max=1000, help="Formulas proposed in a round.")] = 10,
    kept: Annotated[int, typer.Option(min=1, max=100, help="Formulas trained in a round.")] = 5,
    updates: Annotated[int, typer.Option(min=1, max=10**9, help="Updates of a candidate's training.")] = 8000,
    final_updates: Annotated[
        int, typer.Option(min=1, max=10**9, help="Updates of the winner's last training.")
    ] = 40000,
    starts: Annotated[int, typer.Option(min=1, max=64, help="Clips of each driver, 20 s each.")] = 8,
    preferences: Annotated[
        int, typer.Option(min=0, max=10_000, help="Comparisons of known drivers before the first round.")
    ] = 100,
    each: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=64,
            help="Clips in which two candidates are compared; by default all for a rule, else 1.",
        ),
    ] = None,
    transcripts: Annotated[
        Path | None, typer.Option(help="Transcripts of another run, to answer instead of a model.")
    ] = None,
    seed: Seed = 1,
    threads: Annotated[int, typer.Option(min=1, max=MOST_WORKERS, help="Threads of the learner.")] = 1,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page for people; 0 for any.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Design a reward from words: formulas are proposed, trained for minutes, compared, and bred.

    The same command goes on after Ctrl-C.
    """
    need("torch", "train", "training")
    if judge == "people":
        need("uvicorn", "drive", "the page for people")
    import nathlon
    from nathlon.lab.reward.measures import RULE

    with stoppable("The same command goes on."):
        result = nathlon.design_reward(
            task,
            out,
            config=config,
            proposer=proposer,
            judge=judge,
            rule=rule or RULE,
            rounds=rounds,
            candidates=candidates,
            kept=kept,
            updates=updates,
            final_updates=final_updates,
            starts=starts,
            preferences=preferences,
            each=each,
            transcripts=transcripts,
            seed=seed,
            threads=threads,
            port=port,
            progress=not as_json,
        )
    if as_json:
        winner = result.winner.model_dump(mode="json")
        print_json(
            {
                "formula": result.formula,
                "checkpoint": result.checkpoint,
                "page": result.page,
                "winner": winner,
            }
        )
        return
    say(f"Formula     {result.formula}")
    say(f"Checkpoint  {result.checkpoint}")
    say(f"Page        {result.page}")

"""An episode of another world is played again: what is said of that, and what says nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import polars as pl
import pytest

from nathlon.selection.run import PLAYED_AGAIN, Run
from nathlon.sim.errors import InputError


def played(ending: str, distance_m: float = 1.0) -> pl.DataFrame:
    return pl.DataFrame({"race": [0], "car": [0], "ending": [ending], "distance_m": [distance_m]})


def said(again: Callable[[], pl.DataFrame]) -> Any:
    """The fact that a run keeps of a match that finished after 1 m, and was then played again."""
    facts: dict[str, Any] = {}

    def run(matches: list[Any]) -> Iterator[tuple[Any, pl.DataFrame]]:
        yield matches[0], again()

    store: Any = SimpleNamespace(
        facts=lambda run: facts,
        put_fact=lambda run, name, fact: facts.update({name: fact}),
        results_of=lambda keys: played("finished"),
        interrupted=lambda run: [],
    )
    pool: Any = SimpleNamespace(run=run)
    engine: Any = SimpleNamespace()
    own: Any = Run(store, "run", (1,), pool, lambda *_: None, other_engine=engine)
    own._play_again([SimpleNamespace(world="other", key="k", scenario="duel")])
    return facts.get(PLAYED_AGAIN)


def test_what_comes_otherwise_is_said() -> None:
    assert said(lambda: played("finished")) == ""
    for again in (lambda: played("finished", 2.0), lambda: played("policy_raised")):
        assert said(again).startswith("An episode of scenario 'duel' came out otherwise")


@pytest.mark.parametrize("ending", ["interrupted", "simulator_fault", "timed_out"])
def test_what_a_busy_machine_does_is_nobody_s_chance(ending: str) -> None:
    assert said(lambda: played(ending)) is None


def test_a_policy_that_has_gone_since_spoils_nothing() -> None:
    def gone() -> pl.DataFrame:
        raise InputError("a.safetensors: no such file")

    assert said(gone) is None

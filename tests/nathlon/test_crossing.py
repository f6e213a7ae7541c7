"""Which policy with which strategy: the format `event`, from composites to the two-way table."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import polars as pl
import pytest

from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match
from nathlon.arena.results import RESULTS
from nathlon.commands.selection import _print_strategies
from nathlon.policies.sources.identity import policy_id
from nathlon.results.standing import Crossed
from nathlon.selection.crossing import cells
from nathlon.selection.round_robin import TournamentSettings, run_round_robin
from nathlon.selection.run import Run
from nathlon.tournament.two_way import CrossedEntrant
from tests.support.race_results import DEFAULTS

STRATEGIES = {"1 stop": ("", 6), "early": ('strategy = "early"\n', 2)}
POINTS = {"1 stop": 0.5, "early": -0.5, "driver:pace=0.9": 2.0, "driver:pace=0.8": -2.0}


def entered(folder: Path, policy: str, strategy: str) -> Entrant:
    """A composite of a policy on a strategy."""
    path = folder / f"{policy.partition('=')[2]} {strategy}.toml"
    label, laps = STRATEGIES[strategy]
    part = f'[[part]]\npolicy = "{policy}"\n'
    stints = f"[[stint]]\nlaps = {laps}\n[[stint]]\nlaps = 9\n"
    path.write_text(f'name = "{path.stem}"\n{label}{part}{stints}', "utf-8")
    return Entrant(policy_id(str(path)), path.stem, str(path), "unknown", "lindenring", "gt3", None, None)


@pytest.fixture
def entrants(tmp_path: Path) -> list[Entrant]:
    policies = ("driver:pace=0.9", "driver:pace=0.8")
    return [entered(tmp_path, policy, strategy) for policy in policies for strategy in STRATEGIES]


class Planted:
    """A run whose races come out as policies and strategies are, with some luck."""

    def __init__(self, truth: dict[str, float]) -> None:
        self._truth, self._rng = truth, np.random.default_rng(5)
        self.pool = self

    def open(self, openings: Sequence[Any], _on_opened: Any) -> list[Any]:
        assert not openings, "all are at home there"
        return []

    def seeds(self, _stage: str) -> np.random.SeedSequence:
        return np.random.SeedSequence(3)

    def rng(self, _stage: str) -> np.random.Generator:
        return np.random.default_rng(4)

    def note(self, *_facts: Any) -> None:
        pass

    def results(self, _stage: str, matches: Sequence[Match]) -> pl.DataFrame:
        rows = [
            DEFAULTS
            | facts
            | {"points": 5.0 + self._truth[facts["entrant"]] + 0.1 * self._rng.standard_normal()}
            for match in matches
            for race, run in enumerate(match.races)
            for car in range(len(run.seats))
            for facts in [match.seat_facts(race, car)]
        ]
        return pl.DataFrame(rows, schema=RESULTS)


def test_composites_are_policies_with_strategies(entrants: list[Entrant]) -> None:
    plain = Entrant("driver:pace=0.9", "plain", "driver:pace=0.9", "built-in", "", "", None, None)
    assert list(cells([*entrants, plain], [plain.id]).values()) == [
        CrossedEntrant(policy, strategy)
        for policy in ("driver:pace=0.9", "driver:pace=0.8")
        for strategy in STRATEGIES
    ]
    assert cells([plain])[plain.id] == CrossedEntrant("driver:pace=0.9", "0 stops")


def test_an_event_tells_the_effects_of_policies_and_strategies(
    entrants: list[Entrant], capsys: pytest.CaptureFixture[str]
) -> None:
    truth = {e: POINTS[cell.policy] + POINTS[cell.strategy] for e, cell in cells(entrants).items()}
    settings = TournamentSettings(format="event", pairs=4, sequential=False)
    answer, matches = run_round_robin(cast(Run, Planted(truth)), entrants, settings)
    assert {match.scenario for match in matches} == {"grand_prix_stops"}
    table = answer.tables["strategies"]
    effects = {row["policy"] or row["strategy"]: row["effect"] for row in table.head(4).iter_rows(named=True)}
    # Each drives five of the twenty cars; points are those of one.
    assert effects == pytest.approx(POINTS, abs=0.06)
    assert set(table["entrant"].drop_nulls()) == {entrant.id for entrant in entrants}
    _print_strategies([Crossed(**row) for row in table.iter_rows(named=True)])
    head, *rows, effects_of_strategies = [
        line.split("│") for line in capsys.readouterr().out.splitlines() if "│" in line or "┃" in line
    ]
    assert [row[1].strip() for row in rows] == ["driver:pace=0.9", "driver:pace=0.8"]
    assert re.fullmatch(r"\+0\.\d\d \(\+0\.\d\d to \+0\.\d\d\)", effects_of_strategies[2].strip())
    assert "early" in head[0]

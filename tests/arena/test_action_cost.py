"""What an action costs: the policy's own time, of every kind of policy, and nothing that is hashed."""

from __future__ import annotations

from pathlib import Path

import pytest

from nathlon.arena import action_cost
from nathlon.arena.action_cost import measure
from nathlon.arena.decision import Decision
from nathlon.arena.entrant import Entrant
from nathlon.judge.gate.action_time import action_finding
from nathlon.judge.gate.series import RunPair
from nathlon.results.standing import ActionTime
from nathlon.selection.config import Config
from nathlon.selection.gate_settings import GateSettings
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED
from tests.support.games import player, world_of

SLEEPS_S = 0.004
SLEEPER = f"lambda path, seen, done: lambda observation: __import__('time').sleep({SLEEPS_S}) or 0"
RAISER = "lambda path, seen, done: lambda observation: 1 // int(observation.sum() > 9)"


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_cost, "COUNTED", 30)


def test_a_car_is_driven_alone() -> None:
    cost = measure(str(BUNDLED[0]), "racing", "lindenring", "gt3")
    assert cost.actions == 30
    assert 0.0 < cost.median_ms <= cost.p99_ms
    assert cost.model_bytes == BUNDLED[0].stat().st_size


def test_the_time_is_the_policys_own(tmp_path: Path) -> None:
    """Its neighbour at the same table is as slow, and not counted."""
    name = world_of(tmp_path, f"PettingZooWorld({{'duel': envs['duel']}}, load={SLEEPER})")
    slow = tmp_path / "slow.pt"
    slow.write_text("weights")
    cost = measure(str(slow), name, "", "")
    quick = measure(player(tmp_path / "quick.onnx", 3), name, "", "")
    assert cost.actions == quick.actions == 30
    assert cost.median_ms >= 1000 * SLEEPS_S > quick.median_ms


def test_what_answers_with_nothing_has_no_time(tmp_path: Path) -> None:
    name = world_of(tmp_path, f"PettingZooWorld({{'duel': envs['duel']}}, load={{'.bad': {RAISER}}})")
    bad = tmp_path / "policy.bad"
    bad.write_text("weights")
    with pytest.raises(InputError, match=r"policy\.bad"):
        measure(str(bad), name, "", "")


def entrant(name: str) -> Entrant:
    return Entrant(name, name, f"{name}.onnx", "unknown", "", "", None, None)


def test_times_have_the_same_digits_in_every_row() -> None:
    times = [
        ActionTime(name="a", entrant="a", median_ms=ms, p99_ms=10 * ms, actions=9, model_bytes=9, machine="")
        for ms in (0.05, 0.0516, 1.2, 12.3456)
    ]
    assert [one.written for one in times] == [
        *("0.050 / 0.500", "0.052 / 0.516", "1.200 / 12.000", "12.346 / 123.456")
    ]


def test_a_gate_asks_for_the_99th_percentile() -> None:
    pair = RunPair(entrant("new"), entrant("old"))

    def asked(p99_ms: float, actions: int = 1000) -> tuple[Decision, str]:
        times: dict[str, ActionTime | str] = {
            name: ActionTime(
                name=name, entrant=name, median_ms=1.0, p99_ms=p99, actions=actions, model_bytes=None,
                machine="pit (zen)",
            )
            for name, p99 in (("new", p99_ms), ("old", 2.0))
        }  # fmt: skip
        finding = action_finding(pair, 5.0, times)
        return finding.verdict, finding.sentence

    verdict, told = asked(4.0)
    assert verdict == Decision.PASS
    assert "4 in 1,000 actions" in told
    assert "pit (zen)" in told
    assert asked(6.0)[0] == Decision.FAIL
    assert asked(4.0, actions=50)[0] == Decision.CANNOT_TELL
    unknown = action_finding(pair, 5.0, {"new": "new.onnx: took more than 120 s to open"})
    assert unknown.verdict == Decision.CANNOT_TELL
    assert "120 s" in unknown.sentence


def test_the_limit_changes_no_digest() -> None:
    assert Config(gate=GateSettings(action_ms=5.0)).digest == Config().digest

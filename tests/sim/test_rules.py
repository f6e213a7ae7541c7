"""Rules: the shipped ones, your own, and what is said about faulty files."""

from __future__ import annotations

from pathlib import Path

import pytest

from nathlon.sim.data_file import DATA
from nathlon.sim.errors import InputError
from nathlon.sim.rules import load_rules, rule_parameters
from nathlon.sim.scenario import load_scenario
from tests.support.refusals import refusal

SPORTING = (DATA / "rules" / "sporting.toml").read_text("utf-8")


def test_free_rules_cost_nothing_whatever_is_done() -> None:
    p = rule_parameters(load_rules("free"))
    assert p.limits_penalty == p.cut_penalty == p.rear_end_penalty == p.side_swipe_penalty == 0.0


def test_serving_speed_is_100_km_per_hour() -> None:
    for name in ("free", "sporting"):
        assert load_rules(name).serving.speed_m_s * 3.6 == pytest.approx(100.0, abs=0.1)


def test_ones_own_rules_are_read_by_their_path(tmp_path: Path) -> None:
    path = tmp_path / "strict.toml"
    path.write_text(SPORTING.replace("warnings = 3", "warnings = 0").replace("gain_m = 4.0", "gain_m = 1.5"))
    p = rule_parameters(load_rules(str(path)))
    assert (p.warnings, p.cut_gain) == (0, 1.5)
    assert p._replace(warnings=3, cut_gain=4.0) == rule_parameters(load_rules("sporting"))


def test_a_car_that_is_close_sees_the_flag(tmp_path: Path) -> None:
    path = tmp_path / "rules.toml"
    flags = "[blue_flags]\nshown_s = 1.0\nclose_s = 2.0\npatience_s = 9.0\npenalty_s = 5.0\n"
    path.write_text(SPORTING + flags)
    with refusal(path, "close_s must not lie above shown_s"):
        load_rules(str(path))


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("warnings = 3", "warnings = -1", "field limits.warnings is -1: .*greater than or equal to 0"),
        ("warnings = 3", "warnings = 2.5", "field limits.warnings is 2.5: .*integer"),
        ("gain_m = 4.0", "gain_m = inf", "field cutting.gain_m is inf: .*finite"),
        ("gain_m = 4.0", "gain = 4.0", "field cutting.gain_m: Field required"),
        ("heavy_m_s = 6.0", "heavy_m_s = 0.5", "heavy_m_s must not lie below light_m_s"),
        ("rear_end_s = 3.0", "rear_end_s = -3.0", "field contact.rear_end_s is -3.0"),
        ("speed_m_s = 27.78", "speed_m_s = 0", "field serving.speed_m_s is 0: .*greater than 0"),
        ("[serving]", "[drive_through]", "field serving: Field required"),
        ("[serving]", "[serving]\nlane = 1", "field serving.lane is unknown; expected one of speed_m_s$"),
        ("[limits]", "[limits", "not a TOML file"),
    ],
)
def test_faulty_field_is_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    path = tmp_path / "rules.toml"
    assert old in SPORTING
    path.write_text(SPORTING.replace(old, new))
    with refusal(path, complaint):
        load_rules(str(path))


def test_rules_are_a_setting_of_scenarios() -> None:
    assert load_scenario("race:rules=blue_flags").rules == "blue_flags"
    with pytest.raises(InputError, match="rules 'wild' is unknown"):
        load_scenario("race:rules=wild")


def test_unknown_rules_list_the_known() -> None:
    with pytest.raises(
        InputError, match="rules 'wild' is unknown; expected one of blue_flags, free, sporting"
    ):
        load_rules("wild")

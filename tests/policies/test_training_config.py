"""Training configurations: shares of the minibatch, opponents, and the shipped files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nathlon.policies.checkpoint import ANY
from nathlon.policies.training.config import CONFIGS, TrainingConfig, read_config
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.population import Population
from nathlon.policies.training.rewards import Reward
from nathlon.policies.training.rollout import Rollout
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.instruments import Instruments
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

SHIPPED = sorted(CONFIGS.glob("*.toml"))
PAIR = Pair("lindenring", "gt3")

GOOD = """
circuit = "lindenring"
car = "gt3"
updates = 8
updates_per_step = 2
warm_up = 60
replay = 500
checkpoint_every = 4
"""


def read(folder: Path, rollouts: str) -> TrainingConfig:
    path = folder / "config.toml"
    path.write_text(GOOD + rollouts)
    return read_config(path)


def tables(*lines: str) -> str:
    return "".join(
        f'[[rollouts]]\nscenario = "1v1"\nraces = 1\nlearners = 1\nopponents = ["driver"]\n{line}\n'
        for line in lines
    )


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_configuration_fits_its_circuit_and_scenarios(path: Path) -> None:
    config = read_config(path)
    circuit, car = ("lindenring", "gt3") if config.circuit == ANY else (config.circuit, config.car)
    track = load_track(circuit)
    Reward(config.reward, Instruments(track, load_car(car), 0.1))
    assert sum(config.shares) == pytest.approx(1.0)
    for rollouts in config.rollouts:
        scenario = load_scenario(rollouts.scenario)
        scenario.place(track, np.random.default_rng(0))
        assert rollouts.learners <= scenario.cars
        assert max(rollouts.places or [1]) <= scenario.cars
        assert rollouts.learners == scenario.cars or rollouts.opponents or config.opponents


def test_three_circuits_have_a_time_trial_and_racing() -> None:
    trained = {(c.circuit, c.car) for c in map(read_config, SHIPPED)}
    home = {("lindenring", "gt3"), ("porto-sereno", "coupe"), ("grandes-landes", "prototype")}
    assert trained == {*home, (ANY, ANY)}
    names = {path.stem for path in SHIPPED}
    for circuit in ("", "porto-sereno-", "grandes-landes-"):
        assert {f"{circuit}time_trial", f"{circuit}racing"} <= names


def test_shares_are_those_given_or_equal(tmp_path: Path) -> None:
    assert read(tmp_path, tables("share = 0.75", "share = 0.25")).shares == (0.75, 0.25)
    assert read(tmp_path, tables("", "", "", "")).shares == (0.25,) * 4


def test_what_is_written_reads_as_the_same(tmp_path: Path) -> None:
    config = read(tmp_path, tables("share = 0.75\nmistakes = 0.1", "share = 0.25\nplaces = [2]"))
    assert TrainingConfig.model_validate_json(config.model_dump_json()) == config


def test_rollouts_without_opponents_race_those_of_the_run(tmp_path: Path) -> None:
    opponents = 'opponents = ["driver:pace=0.9", { policy = "past", weight = 2 }]\n'
    config = read(tmp_path, opponents + '[[rollouts]]\nscenario = "1v1"\nraces = 1\nlearners = 1\n')
    assert [(o.policy, o.weight) for o in config.opponents] == [("driver:pace=0.9", 1.0), ("past", 2.0)]
    rollout = Rollout(config, config.rollouts[0], PAIR, np.random.default_rng(0))
    assert isinstance(rollout._population, Population)


@pytest.mark.parametrize(
    ("rollouts", "complaint"),
    [
        (tables("share = 0.5", "share = 0.4"), "the shares of the rollouts add up to 0.9, expected 1"),
        (tables("share = 0.5", ""), "share must be given for all rollouts or for none"),
        (tables("share = 0.0"), "field rollouts.0.share is 0.0"),
        (tables("mistakes = 1.5"), "field rollouts.0.mistakes is 1.5"),
        (tables("mistake = 1.0"), "field rollouts.0.mistake is unknown; expected one of .*mistakes, "),
        (tables("") + "[qrsac]\nrate = 1.0", "field qrsac.rate is unknown; expected one of alpha, .*_rate"),
        (tables("places = [1, 2]"), "places must be 1 different ones"),
        (tables("places = [0]"), "field rollouts.0.places.0 is 0"),
        (
            tables("").replace('"driver"', '"self", "past"'),
            "field rollouts.0.opponents .*expected one besides self and past",
        ),
        (
            tables("").replace('"driver"', '{ policy = "driver", weight = -1.0 }'),
            "field rollouts.0.opponents.0.weight is -1.0",
        ),
        (tables("") + "[qrsac]\nfinal_rates = 0.0", "field qrsac.final_rates is 0.0: .*greater than 0"),
        (tables("") + "[qrsac]\nfinal_alpha = 1.5", "field qrsac.final_alpha is 1.5"),
        (tables("") + "[reward.off_course_in]\nSchikane = -1.0", "reward.off_course_in.Schikane is -1.0"),
        (
            tables("") + '[reward]\nexpression = "progress + mass"',
            r"reward.expression is 'progress \+ mass': column 1: m and kg do not go together",
        ),
    ],
)
def test_a_fault_is_named(tmp_path: Path, rollouts: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint) as caught:
        read(tmp_path, rollouts)
    assert "\n" not in str(caught.value)


def test_nobody_to_race_against_is_refused(tmp_path: Path) -> None:
    config = read(tmp_path, '[[rollouts]]\nscenario = "1v1"\nraces = 1\nlearners = 1\n')
    with pytest.raises(InputError, match="opponents is empty, expected someone for 1 of the 2 cars"):
        Rollout(config, config.rollouts[0], PAIR, np.random.default_rng(0))


@pytest.mark.parametrize("text", ['car = "any"\n', "[variety]\npairs = 3\n"])
def test_a_circuit_and_car_or_a_variety_of_them_is_expected(tmp_path: Path, text: str) -> None:
    given = GOOD.replace('car = "gt3"\n', text if text.startswith("car") else "")
    rollouts = '[[rollouts]]\nscenario = "1v0"\nraces = 1\nlearners = 1\n'
    path = tmp_path / "run.toml"
    path.write_text(given + rollouts + (text if text.startswith("[") else ""))
    with pytest.raises(InputError, match="expected one, or a variety"):
        read_config(path)

"""`nathlon plan`: what it counts by itself, what earlier selections teach it, and that it runs nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import nathlon
from nathlon.arena.store import Store
from nathlon.results.forecast import Forecast, StageForecast, sentences
from nathlon.results.summary import Summary
from nathlon.selection.battery import DECATHLON, MARKS_RUNS
from nathlon.selection.battery.skill import load_skills
from nathlon.selection.config import Config
from nathlon.selection.forecasting import ASSUMED, forecast, habits_of
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused
from tests.support.games import player, world_of
from tests.support.opened_page import full_night

LADDER = BUNDLED[0].parent
GAUNTLET = """
[tournament]
format = "gauntlet"
[nightly]
anchors = ["driver", "driver:pace=0.95"]
"""


def night(entered: int, survivors: int, deviation: float, core_s: float = 50.0) -> Summary:
    """A selection of so many entrants, four of whom met in half of their races."""
    stages: list[dict[str, Any]] = [
        {"name": "pareto", "in": entered, "out": survivors, "races": 4 * entered},
        {"name": "battery", "in": survivors, "out": survivors, "races": 112 * survivors},
        {"name": "tournament", "in": 4, "out": 1, "races": 72},
    ]
    clocked = [stage | {"wall_s": core_s / 2, "core_s": core_s, "ran": stage["races"]} for stage in stages]
    like = full_night().summary.model_dump(mode="json")
    new = {"stages": clocked, "unit_deviation": deviation, "circuit": "lindenring", "car": "gt3"}
    return Summary.model_validate(like | new)


def test_what_the_configuration_says_is_counted() -> None:
    told = forecast(Config(), 1000, 3, 1, ASSUMED, 2)
    by_name = {stage.name: stage for stage in told.stages}
    assert by_name["pareto"].entrants == 1003
    assert by_name["pareto"].most_races == 1003 * 2 * 8, "races and time trials"
    tests = load_skills(DECATHLON)
    entrants = by_name["battery"].entrants
    assert by_name["battery"].races == sum(test.runs for test in tests) * entrants + MARKS_RUNS * len(tests)
    assert by_name["tournament"].entrants == 6 + 3 + 1
    assert by_name["tournament"].most_races == 45 * 12 * 2
    assert [budget.pairs for budget in told.budgets] == [12, 24, 48, 96]
    assert told.hours == pytest.approx(sum(stage.core_s or 0.0 for stage in told.stages) / 3600 / 2)


def test_a_selection_like_those_before_it_is_forecast_as_they_went() -> None:
    habits = habits_of([night(300, 9, 2.0), night(300, 9, 4.0)], Config())
    told = forecast(Config(), 300, 0, 0, habits, 2)
    pareto, battery, tournament = told.stages
    assert (told.earlier, pareto.entrants, pareto.races) == (2, 300, 1200)
    assert battery.entrants == 9
    assert pareto.core_s == pytest.approx(50.0)
    assert told.deviation == pytest.approx(10**0.5), "variances are averaged"
    assert tournament.entrants == 6
    assert tournament.races == 15 * 24 // 2, "half of what is allowed, as before"


def test_more_entrants_leave_more_survivors_but_fewer_of_each_thousand() -> None:
    habits = habits_of([night(300, 9, 3.0)], Config())
    survivors = [forecast(Config(), n, 0, 0, habits, 1).stages[1].entrants for n in (300, 3000, 30_000)]
    assert 9 == survivors[0] < survivors[1] < survivors[2] < 90


def test_it_reads_the_store_and_leaves_nothing(tmp_path: Path) -> None:
    with Store(tmp_path / "store.sqlite") as store:
        for number, circuit in enumerate(("lindenring", "porto-sereno")):
            store.begin_run(f"night-{number}", {})
            summary = night(30, 4, 3.0).model_copy(update={"circuit": circuit})
            store.put_fact(f"night-{number}", "summary", summary.model_dump(mode="json"))
    before = sorted(tmp_path.iterdir())
    told = nathlon.plan(LADDER, store=tmp_path / "store.sqlite")
    assert told.earlier == 1, "the other one was on another circuit"
    assert sorted(tmp_path.iterdir()) == before
    assert nathlon.plan(LADDER, store=tmp_path / "none.sqlite").earlier == 0
    assert sorted(tmp_path.iterdir()) == before


def test_the_command_counts_what_the_next_night_would_judge(tmp_path: Path) -> None:
    (tmp_path / "nathlon.toml").write_text(f'checkpoints = ["{LADDER}", "{LADDER}/{BUNDLED[0].name}"]\n')
    done = command("plan", "--json", cwd=tmp_path)
    told = json.loads(done.stdout)
    assert told["newcomers"] == len(list(LADDER.glob("*.safetensors")))
    assert told["stages"][2]["entrants"] == 6 + 1, "the anchor"
    text = command("plan", cwd=tmp_path).stdout
    assert f"{told['newcomers']} checkpoints need about" in text
    assert "told apart in 80 of 100 selections" in text


def test_in_a_gauntlet_there_are_fewer_races(tmp_path: Path) -> None:
    plain = nathlon.plan(LADDER).stages[2]
    path = tmp_path / "nathlon.toml"
    path.write_text(
        '[tournament]\nformat = "gauntlet"\n[nightly]\nanchors = ["driver", "driver:pace=0.95"]\n'
    )
    gauntlet = nathlon.plan(LADDER, config=path).stages[2]
    assert gauntlet.entrants == plain.entrants + 2
    assert (plain.most_races, gauntlet.most_races) == (15 * 24, 12 * 24)


def test_wrong_input_is_one_sentence(tmp_path: Path) -> None:
    refused(command("plan", cwd=tmp_path), "nathlon.toml")
    refused(command("plan", "nowhere", cwd=tmp_path), "nowhere")
    (tmp_path / "empty").mkdir()
    (tmp_path / "nathlon.toml").write_text('checkpoints = ["empty"]\n')
    refused(command("plan", cwd=tmp_path), "nothing is new")
    with pytest.raises(InputError, match="no such file"):
        nathlon.plan(tmp_path / "nowhere")


WAITS = """
import time


def slow():
    game = envs["Game"]("left", "right")
    step = game.step
    game.step = lambda actions: time.sleep(0.003) or step(actions)
    return game


"""


@pytest.fixture(scope="module")
def game(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A world whose game takes some 18 ms, and one with a single seat."""
    folder = tmp_path_factory.mktemp("game")
    name = world_of(folder, "PettingZooWorld({'duel': lambda: slow()}, episode='match')")
    path = folder / "worlds.py"
    path.write_text(path.read_text().replace("world =", f"{WAITS}world ="))
    (folder / "mine").mkdir()
    for right in range(4):
        player(folder / "mine" / f"{right}.onnx", right)
    return folder, name


def test_another_world_s_plan_takes_the_time_that_is_measured_there(game: tuple[Path, str]) -> None:
    folder, name = game
    told = nathlon.plan(folder / "mine", world=name, workers=1)
    assert told.episode == "match"
    assert told.episode_s is not None
    assert told.episode_s >= 6 * 0.003
    by_name = {stage.name: stage for stage in told.stages}
    assert by_name["pareto"].core_s == pytest.approx(told.episode_s * by_name["pareto"].races)
    assert told.core_hours == pytest.approx(told.episode_s * told.races / 3600)
    assert told.budgets == (), "no selection has told yet how much matches vary"
    said = " ".join(sentences(told))
    assert "A match of random policies took 0.0" in said
    assert "matches, " in said
    assert "0 min" not in said
    assert "race" not in said


def test_what_nobody_races_is_not_told_of_in_words_of_racing(game: tuple[Path, str]) -> None:
    folder, _ = game
    alone = world_of(folder, "GymnasiumWorld({'only': envs['Alone']})", "alone.py")
    done = command("plan", "mine/3.onnx", "--world", alone, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "1 checkpoint needs about" in done.stdout
    assert "Nobody is expected to meet" in done.stdout
    assert "tournament" not in done.stdout
    assert "race" not in done.stdout.lower()
    assert "1 workers" not in done.stdout


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(0.4, "less than 1 s"), (20, "20 s"), (186, "3 min"), (3500, "58 min"), (9000, "2.5 h")],
)
def test_what_takes_seconds_does_not_take_no_time(seconds: float, said: str) -> None:
    stage = StageForecast(name="pareto", entrants=2, races=8, most_races=8, core_s=float(seconds))
    told = Forecast(newcomers=2, earlier=1, workers=1, stages=(stage,), deviation=None, power=0.8, budgets=())
    assert f"2 checkpoints need about 8 races, {said} with 1 worker." in sentences(told)

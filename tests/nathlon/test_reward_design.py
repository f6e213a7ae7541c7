"""A reward's design from end to end, stopped and gone on with, by a sampler, a model, people."""

from __future__ import annotations

import json
import re
import shutil
import threading
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser

import nathlon
from nathlon.lab.llm.chat import MODEL, URL, Endpoint
from nathlon.lab.llm.transcripts import Transcripts
from nathlon.lab.reward.alignment import Preference
from nathlon.lab.reward.clips import Clips, Studio
from nathlon.lab.reward.design import Design
from nathlon.lab.reward.drawing import drawing
from nathlon.lab.reward.judging import ClipPair, ClipQuestion, JudgingOnlooker, JudgingRule
from nathlon.lab.reward.library import DRIVER, STILL, library
from nathlon.lab.reward.measures import MEASURES, RULE
from nathlon.lab.reward.people import People
from nathlon.lab.reward.pictures import OWN, Painter
from nathlon.lab.reward.sampling import Sampler
from nathlon.lab.reward.wording import Model as Wordsmith
from nathlon.policies.load import load_policy
from nathlon.policies.training.config import TrainingConfig
from nathlon.reports.reward_page import write_reward_page
from nathlon.sim.errors import InputError
from tests.support.opened_page import faults, overhear, picture, until
from tests.support.reward_designs import STARTS, TASK, filmed, settings
from tests.support.scripted_model import Model, answer, raw_model
from tests.support.trainings import TOML

STEPS_KEPT = (
    "library/preferences.json",
    "round-1/candidates.json",
    "round-1/outcomes.json",
    "final/outcomes.json",
)


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Clips of a library."""
    folder = tmp_path_factory.mktemp("films")
    filmed(folder)
    return folder


@pytest.fixture(scope="module")
def studio() -> Studio:
    return Studio("lindenring", "gt3", STARTS)


def design(folder: Path, films: Path, **other: object) -> Design:
    if not (folder / "library").exists():
        shutil.copytree(films, folder / "library")
    return Design(folder, settings(**other))


class Stop:
    """Ctrl-C, when something begins.

    Args:
        at: what is told of it.
    """

    def __init__(self, at: str) -> None:
        self._at = at

    def __call__(self, done: int, what: str) -> None:
        if what.startswith(self._at):
            raise KeyboardInterrupt


def run(made: Design, stop: str = "never") -> Design:
    made.run(Sampler(1), JudgingRule(made.settings.rule, made.studio.step_s), Stop(stop), lambda: None)
    return made


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, films: Path) -> Design:
    """A design that came to its end at once."""
    return run(design(tmp_path_factory.mktemp("whole"), films))


def test_a_design_keeps_every_step(whole: Design) -> None:
    assert [len([one for one in found if one.kept]) for found in whole.rounds] == [1, 1]
    first, second = whole.outcomes
    assert {one.candidate.name.partition(".")[0] for one in second} == {"1", "2"}, (
        "the best one is compared again"
    )
    kept = [one for one in whole.rounds[0] if one.kept]
    fit = [one for one in whole.rounds[0] if one.alignment]
    assert kept[0].alignment == max((one.alignment for one in fit if one.alignment), key=lambda one: one.tac)
    assert whole.final is not None
    assert whole.final.candidate == second[0].candidate
    policy = load_policy(str(whole.folder / whole.final.checkpoint), "lindenring", "gt3")
    assert policy.observation_spec.course_points == 3
    training = json.loads((whole.folder / "final" / "run.json").read_text())["config"]
    assert training["reward"]["expression"] == TrainingConfig.model_validate(training).reward.expression
    assert first[0].candidate.formula in json.dumps([one.model_dump() for one in whole.rounds[0]])


def test_a_design_that_was_stopped_comes_to_the_same(whole: Design, films: Path, tmp_path: Path) -> None:
    for stop in ("library", "round 1", "1.", "round-1", "final"):
        with pytest.raises(KeyboardInterrupt):
            run(design(tmp_path, films), stop)
    went_on = run(design(tmp_path, films))
    for name in STEPS_KEPT:
        assert (tmp_path / name).read_bytes() == (whole.folder / name).read_bytes(), name
    assert went_on.final == whole.final


def test_a_training_without_its_curve_is_named(whole: Design, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(whole.folder, folder)
    (folder / "final" / "curve.csv").unlink()
    with pytest.raises(InputError, match=r"final/curve\.csv: lacks update \d+, expected"):
        run(Design(folder, whole.settings))


def test_a_folder_is_that_of_one_design(whole: Design, films: Path) -> None:
    with pytest.raises(InputError, match=r"design\.json: of another design, which differs in task"):
        design(whole.folder, films, task="drive slowly")
    with pytest.raises(InputError, match="kept is 9, expected at most the 3 candidates"):
        nathlon.design_reward(TASK, whole.folder, kept=9, candidates=3)
    with pytest.raises(InputError, match="rule"):
        nathlon.design_reward(TASK, whole.folder, rule="pace")


def test_a_damaged_paper_is_named(films: Path, tmp_path: Path) -> None:
    path = tmp_path / "library" / "preferences.json"
    made = design(tmp_path, films)
    path.write_text('{"over": true, "preferences": [{"first": "x"}]}')
    with pytest.raises(InputError, match=r"preferences\.json: preferences\.0"):
        run(made)


def test_its_page_shows_everything(whole: Design, browser: Browser, tmp_path: Path) -> None:
    shown = drawing(whole)
    write_reward_page(shown._replace(task="<b>fast</b>"), tmp_path / "index.html")
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    requests, complaints = overhear(page)
    page.goto((tmp_path / "index.html").as_uri())
    until(page, "document.body.dataset.ready")
    assert page.locator("h1").inner_text() == "<b>fast</b>"
    for found in whole.rounds:
        for one in found:
            assert page.get_by_text(one.formula, exact=True).count() >= 1
    page.select_option("#right", DRIVER)
    until(page, "document.body.dataset.ready.includes(' beside ')")
    assert page.locator("#scene, #scene-beside").count() == 2
    picture(page, "reward", whole=True)
    assert faults(complaints) == []
    assert len([url for url in requests if not url.startswith("data:")]) == 1
    page.close()


FORMULAS = [
    {"formula": "progress / m - 20 * off_course / s", "why": "pace on the road"},
    {"formula": "progress / kerb", "why": "kerbs"},
    {"formula": "1 - progress / m", "why": "calm"},
]


@pytest.fixture
def model() -> Iterator[Model]:
    more = [{"formula": f"progress / m - {n} * touching"} for n in (1, 2)]
    replies = [f"Here:\n```json\n{json.dumps(FORMULAS)}\n```", json.dumps(more)]
    model = Model(replies)
    yield model
    model.close()


def proposed(folder: Path, films: Path, said: Transcripts) -> Design:
    made = design(folder, films, proposer="model")
    with pytest.raises(KeyboardInterrupt):
        made.run(
            Wordsmith(said), JudgingRule(made.settings.rule, made.studio.step_s), Stop("1."), lambda: None
        )
    return made


def test_a_model_is_told_what_was_thrown_out_and_can_be_done_without(
    model: Model, films: Path, tmp_path: Path
) -> None:
    said = Transcripts(tmp_path / "one" / "transcripts", Endpoint(model.url, "small", "secret"))
    made = proposed(tmp_path / "one", films, said)
    [found] = made.rounds
    assert [bool(one.refused) for one in found] == [False, True, True, False, False]
    first, second = (body["messages"][-1]["content"] for body, _ in model.heard)
    assert TASK in first
    assert "progress / kerb: column 12: divides by what may be 0" in second
    assert "pays for standing still" in second
    assert "Write 2 formulas" in second
    kept = json.loads((tmp_path / "one" / "transcripts" / "round-1-propose-2.json").read_text())
    assert kept["model"] == "small"
    assert "secret" not in json.dumps(kept)
    again = proposed(tmp_path / "two", films, Transcripts(tmp_path / "two" / "said", None, said.folder))
    assert again.rounds == made.rounds
    assert len(model.heard) == 2
    with pytest.raises(InputError, match=r"round-1-propose-1\.json: is missing"):
        proposed(tmp_path / "three", films, Transcripts(tmp_path / "three" / "said", None, tmp_path))


def test_a_model_that_is_not_named_is_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in (URL, MODEL):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match="NATHLON_MODEL_URL"):
        nathlon.design_reward(TASK, tmp_path, proposer="model")


def test_a_wrong_key_shows_before_the_first_drive(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(Design, "run", lambda *_: pytest.fail("somebody drives"))
    with raw_model(answer(401, "no such key")) as (url, heard):
        monkeypatch.setenv(URL, url)
        monkeypatch.setenv(MODEL, "small")
        with pytest.raises(InputError, match="it answers 401 Told: no such key"):
            nathlon.design_reward(TASK, tmp_path, judge="model", progress=False)
    assert len(heard) == 1


def asked(films: Path, studio: Studio, count: int) -> ClipQuestion:
    clips = library(studio, films, 1)
    others = [name for name in clips if name not in (DRIVER, STILL)]
    pairs = [ClipPair(DRIVER, name, 0) for name in others[:count]]
    return ClipQuestion("library", TASK, clips, clips[DRIVER], pairs)


def test_a_model_that_looks_is_shown_both_in_changing_order(
    films: Path, studio: Studio, tmp_path: Path
) -> None:
    question = asked(films, studio, 6)
    model = Model(["Let me see.", *['{"better": "A", "why": "closer to the line"}'] * 6])
    found: list[Preference] = []
    said = Transcripts(tmp_path, Endpoint(model.url, "seer", ""))
    JudgingOnlooker(said, studio).judge(question, found.append)
    model.close()
    assert {one.better for one in found} == {-1, 1}, "A is now the first and now the second"
    assert found[0].remark == "closer to the line"
    assert model.heard[1][0]["messages"][-1]["content"] == "Answer with the JSON object only."
    parts = model.heard[0][0]["messages"][1]["content"]
    shown = [part["image_url"]["url"] for part in parts if part["type"] == "image_url"]
    assert len(set(shown)) == 2
    kept = json.loads(next(tmp_path.glob("*-1.json")).read_text())
    assert [set(part) for part in kept["messages"][1]["content"]][1] == {"type", "sha256"}


def test_the_picture_has_the_car_in_question_in_the_middle(films: Path, studio: Studio) -> None:
    clips: Clips = library(studio, films, 1)[DRIVER]
    sheet = np.asarray(Image.open(BytesIO(Painter(studio).paint(clips, 0))).convert("RGB"))
    assert sheet.shape == (480, 960, 3)
    for row in (120, 360):
        for column in (160, 480, 800):
            around = sheet[row - 8 : row + 8, column - 8 : column + 8].reshape(-1, 3)
            assert (around == OWN).all(axis=1).any()


def test_people_compare_without_knowing_whom(films: Path, studio: Studio, browser: Browser) -> None:
    question = asked(films, studio, 4)
    found: list[Preference] = []
    opened: list[str] = []
    there = threading.Event()

    def on_open(url: str) -> None:
        opened.append(url)
        there.set()

    judge = People(studio, on_open=on_open)
    thread = threading.Thread(target=judge.judge, args=(question, found.append), daemon=True)
    thread.start()
    assert there.wait(60.0)
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    _, complaints = overhear(page)
    page.goto(opened[0])

    def shows(pair: int) -> None:
        until(page, f"document.body.dataset.pair === '{pair}'")

    shows(0)
    assert "driver:pace" not in page.content()
    page.fill("#remark", "B leaves no <room>")
    picture(page, "reward-pairs")
    page.click("text=A is better")
    shows(1)
    page.click("text=No difference")
    shows(2)
    page.click("text=B is better")
    shows(3)
    page.click("#enough")
    thread.join(60.0)
    assert not thread.is_alive()
    assert [(one.better, one.remark) for one in found] == [(1, "B leaves no <room>"), (0, ""), (-1, "")]
    assert [one.second for one in found] == [pair.second for pair in question.pairs[:3]]
    assert faults(complaints) == []
    page.close()


def test_the_page_of_measures_tells_them_all() -> None:
    text = (Path(__file__).parent.parent.parent / "docs" / "reward.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (\S+) \| (.+) \|$", text, re.MULTILINE)
    assert rows == [(name, one.unit, one.meaning) for name, one in MEASURES.items()]
    assert f"`{RULE}`" in text


def test_a_design_that_is_over_is_told_again(whole: Design, tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(TOML)
    result = nathlon.design_reward(
        TASK, whole.folder, config=tmp_path / "own.toml", rounds=2, candidates=3, kept=1, updates=1,
        final_updates=1, starts=STARTS, preferences=10, progress=False,
    )  # fmt: skip
    assert result.winner == whole.final
    assert result.page.exists()
    assert result.checkpoint.exists()
    assert result.formula.endswith(f"* ({result.winner.candidate.formula})")

"""A language model may phrase what the coach says, and nothing else; a local server speaks its part."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from nathlon.api.coach import CoachResult
from nathlon.lab.coach.phrasing import phrase, unfounded
from nathlon.lab.coach.words import tell
from nathlon.lab.llm.chat import KEY, MODEL, URL, Endpoint
from nathlon.results.coach import CoachFacts
from nathlon.sim.errors import InputError
from tests.support.command_line import nathlon
from tests.support.scripted_model import Model, answer, raw_model

FACTS = CoachFacts.model_validate(
    {
        "raced": {
            "match": "0", "race": 0, "scenario": "alone", "circuit": "lindenring", "car": "gt3",
            "version": "1",
        },
        "car": 0,
        "name": "ann-020k",
        "lap": {"number": 1, "lap_s": 106.074, "start_s": 3.27, "flying": True, "off_course": False},
        "laps": [],
        "other": "bob-059k",
        "other_kind": "champion",
        "other_lap_s": 104.932,
        "limit_s": None,
        "lost_s": 1.142,
        "sections": [
            {
                "name": name, "kind": "corner", "start_m": 0, "end_m": 9, "time_s": 5, "other_s": 4,
                "lost_s": lost, "causes": [
                    {"kind": "braking_early", "own": 350, "other": 350 + early, "at_m": 350, "at_s": 9}
                ],
            }
            for name, lost, early in (("Linde", 0.123, 9), ("Kehre", 0.152, 12))
        ],
        "consistency": None,
        "craft": {},
        "advice": [],
        "alternatives": [],
        "attempts": [{"section": "Linde", "tried": 28, "gained": 0}],
        "together_s": None,
        "starts": [],
    }
)  # fmt: skip
NOTES = tell(FACTS)
GOOD = (
    "Your best lap on lindenring took 106.07 s, that is 1.142 s more than bob-059k.\n"
    "In Linde you are braking 9 metres earlier, which costs 0.12 seconds. "
    "Kehre costs 0.152 s: there it is 12 m."
)


@pytest.mark.parametrize(
    ("reply", "refused"),
    [
        (GOOD, []),
        ("Linde costs 0.13 s.", ["0.13 s in Linde"]),
        ("Linde costs 0.152 s.", ["0.152 s in Linde"]),  # which is that of another section
        ("Linde costs 0.123 m.", ["0.123 m in Linde"]),
        ("Linde costs a tenth.", ["tenth"]),
        ("You brake like Senna in Kehre.", ["Senna"]),
        ("Monza would suit you.", ["Monza"]),
        ("Ask bob-060k.", ["bob-060k"]),
        ("", ["anything that can be read"]),
        ("Linde \x1b[31m", ["anything that can be read"]),
    ],
)
def test_what_is_not_in_the_facts_is_refused(reply: str, refused: list[str]) -> None:
    found = unfounded(FACTS, NOTES, reply)
    assert (found == []) == (refused == []), found
    assert set(refused) <= set(found)


def test_a_lap_as_long_as_the_other_is_neither_more_nor_less() -> None:
    told = tell(FACTS.model_copy(update={"lost_s": -0.0004}))
    assert "That is as long as the lap of " in told


def test_the_coach_s_own_sentences_are_in_the_facts() -> None:
    assert unfounded(FACTS, NOTES, NOTES) == []


@pytest.fixture
def model() -> Iterator[Model]:
    model = Model(["Linde costs 7 s, says Senna.", GOOD])
    yield model
    model.close()


def test_a_model_is_asked_again_and_told_why(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in ((URL, model.url + "/"), (MODEL, "small"), (KEY, "secret")):
        monkeypatch.setenv(name, value)
    phrased = phrase(FACTS, NOTES, Endpoint.from_environment())
    assert phrased.text == GOOD + "\n"
    assert [bool(attempt.refused) for attempt in phrased.attempts] == [True, False]
    (first, key), (second, _) = model.heard
    assert (first["model"], key) == ("small", "Bearer secret")
    assert first["messages"][1]["content"] == NOTES
    assert "7 s in Linde" in second["messages"][-1]["content"]
    assert "Senna" in second["messages"][-1]["content"]


def test_who_says_nothing_right_is_not_heard(model: Model) -> None:
    stubborn = Model(["It was Senna.", "It was Senna."])
    phrased = phrase(FACTS, NOTES, Endpoint(stubborn.url, "small", ""))
    stubborn.close()
    assert phrased.text is None
    assert phrased.attempts[-1].refused == ["Senna"]
    assert stubborn.heard[0][1] is None, "no key, no header"


def test_a_model_that_is_none_is_refused(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="answers otherwise"):
        Endpoint(model.url + "/else", "small", "").say([])
    with pytest.raises(InputError, match="cannot be asked"):
        Endpoint("http://127.0.0.1:9/v1", "small", "").say([])
    monkeypatch.setenv(URL, "file:///etc/passwd")
    with pytest.raises(InputError, match="NATHLON_MODEL_URL is 'file:///etc/passwd', expected the address"):
        Endpoint.from_environment()
    monkeypatch.setenv(URL, model.url)
    monkeypatch.delenv(MODEL, raising=False)
    with pytest.raises(InputError, match="NATHLON_MODEL is not set"):
        Endpoint.from_environment()


def test_advice_does_not_depend_on_a_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with raw_model(answer(401, '{"error": "no such key"}')) as (url, _):
        phrased = phrase(FACTS, NOTES, Endpoint(url, "small", "secret"))
    assert (phrased.text, phrased.attempts) == (None, ())
    assert phrased.unasked.endswith("cannot be asked: it answers 401 Told: no such key")
    result = CoachResult(tmp_path, FACTS, NOTES, phrased)
    monkeypatch.setattr("nathlon.coach", lambda *_, **__: result)
    monkeypatch.setattr("nathlon.arena.workers.start_server", lambda: None)
    done = nathlon("coach", "race.mcap", "--car", "1", "--phrase", "--json", cwd=tmp_path)
    assert done.returncode == 0
    assert json.loads(done.stdout) == json.loads(FACTS.model_dump_json())
    assert done.stderr == f"The words are the coach's own: {phrased.unasked}\n"

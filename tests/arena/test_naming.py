"""Names say which run a file is of, in as few words as that takes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nathlon.arena.entrant import Entrant, named_apart, only_once
from nathlon.arena.naming import longer, short_names

RUNS = [f"/data/run{letter}/checkpoints/step-0010000.safetensors" for letter in "ABC"]


def entrant(source: str, identity: str, name: str) -> Entrant:
    return Entrant(identity, name, source, "QR-SAC", "lindenring", "gt3", 1, 1)


def names(*sources: str) -> list[str]:
    return list(short_names(sources).values())


def test_runs_are_told_apart_by_their_folders() -> None:
    """Instead of `step-0010000`, `checkpoints/step-0010000` and `checkpoints/step-0010000-387666`."""
    assert names(*RUNS) == [f"run{letter}/checkpoints/step-0010000" for letter in "ABC"]
    entered = [entrant(source, source[9] * 64, "step-0010000") for source in RUNS]
    assert [one.name for one in only_once(entered)] == names(*RUNS)


@pytest.mark.parametrize(
    ("sources", "expected"),
    [
        (["a/x.onnx", "a/y.onnx"], ["x", "y"]),
        (["a/x.onnx", "b/x.onnx", "c/z.onnx"], ["a/x", "b/x", "z"]),
        (["r/a/x.onnx", "s/a/x.onnx", "s/b/x.onnx"], ["r/a/x", "s/a/x", "s/b/x"]),
        (["a/x.onnx", "a/x.zip"], ["x.onnx", "x.zip"]),
        (["a/x.onnx", "a/x.zip", "b/x.zip"], ["x.onnx", "x.zip", "x"]),
        (["plugin:x", "a/x.onnx"], ["x"]),
        (["a/chase.roles.toml", "b/chase.roles.toml"], ["a/chase", "b/chase"]),
        (["a/x.onnx", "./a/x.onnx"], ["x", "x"]),
    ],
)
def test_as_few_folders_as_tell_apart(sources: list[str], expected: list[str]) -> None:
    assert names(*sources) == expected


def test_a_folder_names_all_of_its_files_alike() -> None:
    """What a run leaves tomorrow is called after the run, though nobody else has come so far."""
    assert (
        names(*RUNS, "/data/runA/checkpoints/step-0020000.safetensors")[-1] == "runA/checkpoints/step-0020000"
    )


def test_a_name_that_is_taken_gets_a_folder_and_then_the_id() -> None:
    one = entrant("/data/runA/latest.onnx", "abcdef99", "latest")
    short = short_names([one.source])
    called = [
        named_apart([one], short, taken)[0].name
        for taken in (set(), {"latest"}, {"latest", "runA/latest"}, {"runA/latest"})
    ]
    assert called == ["latest", "runA/latest", "runA/latest-abcdef", "latest"]
    assert longer("/x.onnx", "x") == "x"


def test_names_of_their_own_are_told_apart_as_well() -> None:
    """Composites, whose files say what they are called, and plugins."""
    both = [entrant(f"/{folder}/c.toml", f"{folder}bcdef99", "calm") for folder in "ab"]
    plugin = entrant("plugin:calm", "9" * 64, "calm")
    found = [one.name for one in named_apart([*both, plugin], short_names(["/a/c.toml", "/b/c.toml"]))]
    assert found == ["a/calm", "b/calm", "calm"]


def test_of_equal_files_the_first_knows_the_others() -> None:
    same = [entrant(source, "a" * 64, "step-0010000") for source in (*RUNS, RUNS[0])]
    [kept] = only_once(same)
    assert kept == replace(same[0], also=tuple(RUNS[1:]))

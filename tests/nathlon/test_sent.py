"""What is sent is kept with its digest, whatever becomes of the file."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from nathlon.arena.entrant import Entrant, entrants_table
from nathlon.arena.store import Store
from nathlon.policies.sources.identity import policy_id
from nathlon.results.summary import Sent
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.publish.sent import keep_sent, kept_copies
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED
from tests.support.selections import with_tables


def send(folder: Path, source: str, name: str = "runA/step") -> tuple[Entrant, Sent]:
    """A night that sends what lies at a source, and what is kept of it."""
    identity = policy_id(source)
    entrant = Entrant(identity, name, source, "QR-SAC", "lindenring", "gt3", 1, 1)
    summary = with_tables({}, sent=[{"name": name, "entrant": identity}]).summary
    with Store(folder / "store.sqlite") as store:
        store.begin_run("night-0001", {})
        store.put_table("night-0001", "entrants", entrants_table([entrant]))
        store.put_fact("night-0001", "summary", summary.model_dump(mode="json"))
    return entrant, keep(folder)


def keep(folder: Path) -> Sent:
    with Store.open(folder / "store.sqlite") as store:
        [sent] = keep_sent(store, "night-0001", OutputFolder(folder / "nights" / "night-0001"))
    return sent


@pytest.fixture
def checkpoint(tmp_path: Path) -> Path:
    return Path(shutil.copy(BUNDLED[0], tmp_path / "step.safetensors"))


def test_a_copy_is_kept_that_outlives_the_file(tmp_path: Path, checkpoint: Path) -> None:
    entrant, sent = send(tmp_path, str(checkpoint))
    assert sent.path == "sent/runA-step.safetensors"
    copy = tmp_path / "nights" / "night-0001" / sent.path
    assert copy.read_bytes() == BUNDLED[0].read_bytes()
    assert sent.digest == entrant.id == hashlib.sha256(copy.read_bytes()).hexdigest()
    checkpoint.unlink()
    assert keep(tmp_path) == sent
    assert kept_copies(tmp_path / "nights", entrant) == [str(copy)]
    copy.write_bytes(b"spoilt")
    assert kept_copies(tmp_path / "nights", entrant) == []


@pytest.mark.parametrize("change", [Path.unlink, lambda path: shutil.copy(BUNDLED[1], path)])
def test_what_is_gone_or_another_one_is_not_sent(
    tmp_path: Path, checkpoint: Path, change: Callable[[Path], object]
) -> None:
    _, sent = send(tmp_path, str(checkpoint))
    (tmp_path / "nights" / "night-0001" / str(sent.path)).unlink()
    change(checkpoint)
    with pytest.raises(InputError, match=r"step\.safetensors: is gone or has changed"):
        keep(tmp_path)
    assert not list((tmp_path / "nights").rglob("*.safetensors"))


def test_a_composite_and_roles_are_kept_with_their_parts(tmp_path: Path) -> None:
    for name, source in (("a", BUNDLED[0]), ("b", BUNDLED[1])):
        (tmp_path / name).mkdir()
        shutil.copy(source, tmp_path / name / "step.safetensors")
    (tmp_path / "both.toml").write_text(
        'name = "both ä"\n[[part]]\npolicy = "a/step.safetensors"\nuntil_m = 100.5\nsections = ["T1"]\n'
        '[[part]]\npolicy = "driver:pace=0.9"\ncircuit = "lindenring"\n'
        '[[part]]\npolicy = "b/step.safetensors"\n'
        '[[stint]]\nlaps = 4\ncompound = "racing-soft"\nfuel_kg = 35\n[[stint]]\nlaps = 8\n'
    )
    (tmp_path / "hunt.roles.toml").write_text(
        '[roles]\n"the prey" = "a/step.safetensors"\nchaser = "b/step.safetensors"\nreferee = "random"\n'
    )
    for name in ("both.toml", "hunt.roles.toml"):
        source = tmp_path / name
        entrant, sent = send(tmp_path / name.split(".")[0], str(source), "mine")
        copy = tmp_path / name.split(".")[0] / "nights" / "night-0001" / str(sent.path)
        assert policy_id(str(copy)) == entrant.id
        assert {path.suffix for path in copy.parent.iterdir()} == {".toml", ".safetensors"}
        assert str(tmp_path / "a") not in copy.read_text("utf-8")


PLANNER = """
[planner]
fuel_s_kg = 0.03
stop_s = 12.0
[[planner.compound]]
name = "racing-soft"
lap_s = [100.0, 101.0]
used_kg = [4.0, 4.0]
wear = [0.1, 0.2]
[[planner.compound]]
name = "racing-hard"
lap_s = [101.0]
used_kg = [4.0]
wear = [0.1]
"""


@pytest.mark.parametrize(("before", "after"), [("", PLANNER), ('strategist = "mine.py:Mine"\n', "")])
def test_a_composite_is_kept_with_its_strategist(tmp_path: Path, before: str, after: str) -> None:
    (tmp_path / "mine.py").write_text("class Mine: ...\n", "utf-8")
    source = tmp_path / "own.toml"
    source.write_text(f'name = "own"\n{before}[[part]]\npolicy = "driver:pace=0.9"\n{after}', "utf-8")
    entrant, sent = send(tmp_path, str(source), "mine")
    (tmp_path / "mine.py").unlink()
    assert policy_id(str(tmp_path / "nights" / "night-0001" / str(sent.path))) == entrant.id


def test_what_is_no_file_is_only_named(tmp_path: Path) -> None:
    _, sent = send(tmp_path, "driver:pace=0.9", "driver")
    assert (sent.name, sent.path, sent.digest) == ("driver", None, None)


def test_long_names_stay_apart(tmp_path: Path, checkpoint: Path) -> None:
    name = "runs/" + "a" * 60 + "/step"
    entrant, sent = send(tmp_path, str(checkpoint), name)
    assert sent.path is not None
    assert sent.path.endswith(f"-{entrant.id[:6]}.safetensors")

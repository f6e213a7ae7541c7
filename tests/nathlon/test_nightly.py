"""Nights: only what is new is judged, nights compare, and a killed night ends as if nothing had happened."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from nathlon.arena.claimant import owner_name
from nathlon.arena.entrant import Entrant, enter
from nathlon.arena.pool import Pool
from nathlon.arena.recording import recording_name
from nathlon.arena.results import TABLES
from nathlon.arena.store import Store
from nathlon.lab.pack.packing import pack_run
from nathlon.lab.pack.verifying import Verification, verify_pack
from nathlon.lab.sinks.telling import tell_night
from nathlon.policies.checkpoint import read_checkpoint, save_checkpoint
from nathlon.policies.sources.identity import policy_id
from nathlon.results.summary import Sent, SetAside, read_summary
from nathlon.selection.config import TEMPLATE, Config, read_config
from nathlon.selection.field import EntryList
from nathlon.selection.nightly.night import GATE, HEALTH, NOT_JUDGED, OK, Night, awaited, judge, nightly, told
from nathlon.selection.run import DONE, KERNELS, RECORDINGS, STAGES
from nathlon.sim.errors import InputError
from tests.support import forked
from tests.support.checkpoints import BUNDLED
from tests.support.clocks import Jumping
from tests.support.command_line import nathlon, refused
from tests.support.packs import repacked
from tests.support.selections import build

pytestmark = pytest.mark.takes_long

GOOD = [path for path in BUNDLED if path.stem in ("lindenring-s1-032k", "lindenring-s1-040k")]
WEAK = next(path for path in BUNDLED if path.stem == "lindenring-s1-008k")

SMALL = """
checkpoints = ["checkpoints"]
seed = 3
[pareto]
scenario = "slipstream_pass"
races = 1
most_races = 1
opponents = ["driver:pace=0.9"]
[battery]
tests = ["pass_left"]
runs = 2
[committee]
shortlist = 2
[tournament]
event = "event.toml"
pairs = 2
block = 2
[nightly]
anchors = ["driver:pace=0.9"]
incumbents = 1
"""
EVENT = """
[[race]]
name = "duel"
circuit = "lindenring"
car = "gt3"
format = "1v1"
scenario = "slipstream_pass"
"""
"""Races of seconds: what they are made of is tested elsewhere."""
NOBODY_LISTENS = '[results]\nwebhook = "https://127.0.0.1:9"\n'


def run(folder: Path) -> Night:
    config = read_config(folder / "nathlon.toml")
    night = nightly(config, 1, lambda *_: None)
    told(config, night)
    return night


def watch_two(folder: Path, settings: str = SMALL) -> Path:
    """A folder with a configuration and two checkpoints to watch."""
    (folder / "checkpoints").mkdir(parents=True)
    for path in GOOD:
        shutil.copy(path, folder / "checkpoints")
    configure(folder, settings)
    return folder


def configure(folder: Path, settings: str = SMALL) -> None:
    (folder / "nathlon.toml").write_text(settings)
    (folder / "event.toml").write_text(EVENT)


def outcome(folder: Path) -> dict[str, Any]:
    """All that a store says, without when it was said."""
    with Store.open(folder / "nathlon.sqlite") as store:
        assert not store.verify()
        runs = {}
        for record in store.runs():
            facts: Any = store.facts(record.name)
            facts.pop("progress")
            timed = facts.pop("action_times"), facts["summary"].pop("action_times")
            assert len(timed[0]) == len(timed[1]) > 0
            for told in (facts["summary"], facts["forecast"], facts["summary"]["forecast"]):
                for stage in told["stages"]:
                    for clocked in ("wall_s", "ran", "core_s"):
                        stage.pop(clocked, None)
            runs[record.name] = {
                "status": record.status,
                "facts": facts,
                "results": store.results_of_run(record.name).rows(),
                "tables": {
                    name: store.table(record.name, name).drop("source", strict=False).rows()
                    for name in TABLES
                },
                "committee": [entry.entry for entry in store.log("committee", record.name)],
            }
        return {"runs": runs, "matches": store.results().height}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return watch_two(tmp_path_factory.mktemp("nights"))


@pytest.fixture(scope="module")
def nights(folder: Path) -> list[Night]:
    """A night of two checkpoints, one with nothing new, and one of a third beside a broken file."""
    nights = [run(folder), run(folder)]
    shutil.copy(WEAK, folder / "checkpoints")
    (folder / "checkpoints" / "broken.safetensors").write_bytes(b"no checkpoint")
    return [*nights, run(folder)]


@pytest.fixture
def store(folder: Path, nights: list[Night]) -> Iterator[Store]:
    with Store.open(folder / "nathlon.sqlite") as store:
        yield store


def test_the_first_night_sends_somebody(folder: Path, nights: list[Night]) -> None:
    night = nights[0]
    assert (night.name, night.status, night.code) == ("night-0001", "done", OK)
    assert night.selection is not None
    sent = night.selection.summary.sent[0].name
    assert sent in {path.stem for path in GOOD}
    assert night.reason == f"{sent} is sent."
    for path in ("report/index.html", "report/ranking.xlsx", "summary.json"):
        assert (folder / "nights" / "night-0001" / path).stat().st_size > 100


def test_every_race_of_the_final_stage_leaves_a_recording(folder: Path, store: Store) -> None:
    for name in ("night-0001", "night-0002"):
        raced = store.results_of_run(name, "tournament").select("match", "race").unique()
        names = {recording_name(match, race) for match, race in raced.iter_rows()}
        there = {path.name for path in (folder / "nights" / name / "races").iterdir()}
        assert len(names) >= 4
        assert there - {"final.mcap"} == names


def test_a_night_without_anything_new_does_nothing(nights: list[Night]) -> None:
    assert nights[1] == Night(None, "done", OK, "Nothing is new.", None)


def test_only_what_is_new_is_judged_against_the_best_so_far(store: Store, nights: list[Night]) -> None:
    assert nights[2].name == "night-0002"
    best = store.table("night-0001", "pool").filter(~pl.col("entrant").str.starts_with("driver"))
    best = best.sort("rank", "points_per_race", descending=[False, True])["entrant"][0]
    entrants = store.table("night-0002", "entrants")
    assert set(entrants["name"]) >= {WEAK.stem, "driver:pace=0.9"}
    assert best in entrants["entrant"]
    assert entrants.height == 3
    assert best in store.table("night-0002", "ranking")["entrant"]


def test_a_broken_file_is_set_aside_and_shown_once(folder: Path, nights: list[Night]) -> None:
    night = nights[2]
    assert night.selection is not None
    [item] = night.selection.summary.excluded
    assert item.source.endswith("broken.safetensors")
    assert night.code == HEALTH
    assert night.reason == "1 of 2 new files were set aside."
    assert run(folder).reason == "Nothing is new."


def test_the_pool_joins_the_nights(store: Store, nights: list[Night]) -> None:
    first, second = (store.table(name, "pool") for name in ("night-0001", "night-0002"))
    tonight = store.table("night-0002", "ranking")
    assert set(second["entrant"]) == set(first["entrant"]) | set(tonight["entrant"])
    pairs = dict(second.select("entrant", "pairs").iter_rows())
    anchor = "driver:pace=0.9"
    before, now = (table.filter(pl.col("entrant") == anchor)["pairs"][0] for table in (first, tonight))
    assert pairs[anchor] == before + now


def test_only_broken_files_are_bad_for_the_health(tmp_path: Path) -> None:
    (tmp_path / "checkpoints").mkdir()
    configure(tmp_path)
    assert run(tmp_path).code == OK
    (tmp_path / "checkpoints" / "broken.safetensors").write_bytes(b"no checkpoint")
    config = read_config(tmp_path / "nathlon.toml")
    for _ in range(2):  # until it is told
        night = nightly(config, 1, lambda *_: None)
        assert (night.name, night.code) == (None, HEALTH)
        assert "broken.safetensors" in night.reason
    told(config, night)
    assert run(tmp_path) == Night(None, "done", OK, "Nothing is new.", None)
    (tmp_path / "checkpoints" / "broken.safetensors").write_bytes(b"still none")
    assert run(tmp_path).code == HEALTH


def test_what_another_process_tells_is_not_told_again(
    tmp_path: Path, folder: Path, nights: list[Night]
) -> None:
    """It has a lease: if it ends before it has told a night, another process does."""
    watch_two(tmp_path, SMALL + NOBODY_LISTENS)
    shutil.copytree(folder / "nights", tmp_path / "nights")
    other = owner_name()
    with Store.open(folder / "nathlon.sqlite") as store, Store(tmp_path / "nathlon.sqlite") as copy:
        store.copy_to(copy)
        for night in ("night-0001", "night-0002"):
            outcome: Any = copy.facts(night)["outcome"]
            copy.put_fact(night, "outcome", outcome | {"told": False})
        assert copy.claim(["telling night-0001"], other, 60.0)
        shutil.copy(WEAK, tmp_path / "checkpoints")
        assert run(tmp_path).name == "night-0002"
        assert run(tmp_path).reason == "Nothing is new."
        copy.release(other)
        told_late = run(tmp_path)
        assert (told_late.name, told_late.told_elsewhere) == ("night-0001", False)
        assert run(tmp_path).name is None
        broken = tmp_path / "checkpoints" / "broken.safetensors"
        broken.write_bytes(b"none")
        assert copy.claim(["telling files set aside"], other, 60.0)
        quiet = run(tmp_path)
        assert (quiet.code, quiet.counts) == (HEALTH, False)
        copy.release(other)
        assert run(tmp_path).counts
    assert tell_night(replace(told_late, told_elsewhere=True), read_config(tmp_path / "nathlon.toml")) == ()


def test_an_empty_folder_is_told(tmp_path: Path) -> None:
    (tmp_path / "checkpoints").mkdir()
    configure(tmp_path)
    folder = tmp_path / "checkpoints"
    assert run(tmp_path).reason == f"Nothing is new: {folder} holds no checkpoint."
    entrant = enter(str(GOOD[0]), "lindenring", "gt3")
    judged = EntryList((replace(entrant, source=str(folder / "a" / "step.safetensors")),))
    with Store(tmp_path / "nathlon.sqlite") as store:
        store.begin_run("night-0001", {"world": {}, "field": asdict(judged)})
        store.end_run("night-0001", "done")
    with pytest.raises(InputError, match="checkpoints: holds no checkpoint any more"):
        run(tmp_path)


def test_what_is_gone_is_not_sent_and_what_was_sent_is_found_again(tmp_path: Path) -> None:
    """One of two that drive alike is deleted while they race; the other is renamed before the next night."""
    watch_two(tmp_path)
    first, stays = (tmp_path / "checkpoints" / path.name for path in GOOD)
    first.unlink()
    card, tensors = read_checkpoint(stays)
    gone = tmp_path / "checkpoints" / "a-twin.safetensors"
    save_checkpoint(gone, tensors, card.model_copy(update={"step": card.step + 1}))
    config = read_config(tmp_path / "nathlon.toml")
    night = nightly(
        config, 1, lambda stage, *_: gone.unlink(missing_ok=True) if stage == "tournament" else None
    )
    told(config, night)
    assert night.selection is not None
    summary = night.selection.summary
    assert (night.code, night.reason) == (OK, f"{stays.stem} is sent.")
    assert [item.source for item in summary.gone] == [str(gone)]
    [sent] = summary.sent
    copy = tmp_path / "nights" / "night-0001" / str(sent.path)
    assert copy.read_bytes() == stays.read_bytes()
    with Store.open(tmp_path / "nathlon.sqlite") as store:
        pack_run(tmp_path / "nights" / "night-0001", store, tmp_path / "night.zip")
    assert looked_into(tmp_path / "night.zip", sample=1)[3:5] == ((gone.stem,), 1)
    assert read_summary(tmp_path / "nights" / "night-0001" / "summary.json").sent == (sent,)
    renamed = stays.rename(tmp_path / "checkpoints" / "champion.safetensors")
    shutil.copy(WEAK, tmp_path / "checkpoints")
    result = nathlon("nightly", "--json", cwd=tmp_path)
    assert result.returncode == OK, result.stderr
    said = json.loads(result.stdout)
    with Store.open(tmp_path / "nathlon.sqlite") as store:
        sources = dict(store.table("night-0002", "entrants").select("entrant", "source").iter_rows())
    assert sources[sent.entrant] == str(renamed)
    assert Path(said["report"]).is_file()
    assert Path(said["sent"][0]["path"]).parent == tmp_path / "nights" / "night-0002" / "sent"
    assert hashlib.sha256(Path(said["sent"][0]["path"]).read_bytes()).hexdigest() == said["sent"][0]["digest"]


def test_files_that_go_while_a_night_runs_are_set_aside_and_the_night_goes_on(tmp_path: Path) -> None:
    """One is deleted after it was opened, one is cut; nobody has raced them by then."""
    watch_two(tmp_path)
    checkpoints = tmp_path / "checkpoints"
    lost, cut = (
        Path(shutil.copy(WEAK, checkpoints / name)) for name in ("lost.safetensors", "cut.safetensors")
    )
    card, tensors = read_checkpoint(lost)
    save_checkpoint(lost, tensors, card.model_copy(update={"step": card.step + 1}))

    def spoil(stage: str, *_: int) -> None:
        if stage == KERNELS:
            lost.unlink(missing_ok=True)
            cut.write_bytes(WEAK.read_bytes()[:1000])

    config = read_config(tmp_path / "nathlon.toml")
    night = nightly(config, 1, spoil)
    told(config, night)
    assert night.selection is not None
    assert (night.code, night.reason) == (HEALTH, "2 of 4 new files were set aside.")
    summary = night.selection.summary
    assert [Path(item.source).name for item in summary.excluded] == ["cut.safetensors", "lost.safetensors"]
    assert all("is gone, has changed" in item.reason for item in summary.excluded)
    assert {one.name for one in summary.sent} <= {path.stem for path in GOOD}
    # Nobody has judged them: what comes back is new.
    shutil.copy(WEAK, cut)
    with Store.open(tmp_path / "nathlon.sqlite") as store:
        assert awaited(config, store)[0] == 1


def test_nights_have_seeds_of_their_own(store: Store, nights: list[Night]) -> None:
    seeds = [set(store.results_of_run(name)["seed"]) for name in ("night-0001", "night-0002")]
    marks = set(store.results_of_run("night-0001", "battery").filter(pl.col("entrant") == "driver")["seed"])
    assert seeds[0] & seeds[1] <= marks


def test_the_status_command(folder: Path, nights: list[Night]) -> None:
    result = nathlon("status", "--verify", "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    said = json.loads(result.stdout)
    assert [record["status"] for record in said["runs"]] == ["done", "done"]
    assert said["runs"][1]["facts"]["outcome"]["code"] == HEALTH
    assert said["disagreements"] == []


ASIDE, SENT = SetAside(source="a", reason="b"), (Sent(name="a", entrant="a"),)


@pytest.mark.parametrize(
    ("facts", "code"),
    [
        ({"faults": 1}, OK),
        ({"faults": 11}, HEALTH),
        ({"void": 11}, HEALTH),
        ({"sent": ()}, GATE),
        ({"sent": (), "faults": 50}, HEALTH),
        ({"excluded": (ASIDE,) * 2}, HEALTH),
        ({"excluded": (ASIDE,)}, OK),
    ],
)
def test_the_exit_code(facts: dict[str, Any], code: int) -> None:
    healthy = {
        "faults": 0,
        "void": 0,
        "car_runs": 100,
        "excluded": (),
        "sent": SENT,
    }
    plain = build(np.random.default_rng(0)).summary
    assert judge(plain.model_copy(update=healthy | facts), 10, 0.1)[0] == code


def vote_for_the_first(folder: Path) -> str:
    """Ann's vote in the latest decision for the one that stands first, who is returned."""
    shown = nathlon("committee", "nathlon.sqlite", "show", "--json", cwd=folder)
    first: str = json.loads(shown.stdout)[-1]["standings"][0]["name"]
    said = ("--member", "ann", "--rank", first, "--reason", "I know it.")
    voted = nathlon("committee", "nathlon.sqlite", "vote", *said, cwd=folder)
    assert voted.returncode == 0, voted.stderr
    return first


def test_people_are_waited_for(tmp_path: Path) -> None:
    settings = SMALL.replace("[committee]\n", '[committee]\nmembers = ["ann"]\nquorum = 1\n')
    watch_two(tmp_path, settings)
    assert (run(tmp_path).status, run(tmp_path).status) == ("waiting", "waiting")
    with Store.open(tmp_path / "nathlon.sqlite") as store:
        assert store.table("night-0001", "ranking").is_empty()
    vote_for_the_first(tmp_path)
    assert run(tmp_path).status == "waiting"
    with Store.open(tmp_path / "nathlon.sqlite") as store:
        assert not store.table("night-0001", "ranking").is_empty()
    chosen = vote_for_the_first(tmp_path)
    night = run(tmp_path)
    assert (night.name, night.status, night.reason) == ("night-0001", "done", f"{chosen} is sent.")


def test_a_night_with_a_changed_configuration_is_abandoned(tmp_path: Path) -> None:
    waiting = SMALL.replace("[committee]\n", '[committee]\nmembers = ["ann"]\nquorum = 1\n')
    watch_two(tmp_path, waiting)
    assert run(tmp_path).status == "waiting"
    configure(tmp_path)
    assert run(tmp_path).name == "night-0002"
    with Store.open(tmp_path / "nathlon.sqlite") as store:
        assert [record.status for record in store.runs()] == ["abandoned", "done"]


FORKED = """
import os, signal, sys
from nathlon.selection.nightly.night import nightly

def is_killed(night):
    child = os.fork()
    if child == 0:
        night()
        os._exit(0)
    _, status = os.waitpid(child, 0)
    return os.WIFSIGNALED(status)

def dies(*_):
    os.kill(os.getpid(), signal.SIGKILL)
"""
"""Nights in processes forked from one, to be killed."""

KILLED = (
    FORKED
    + """
from pathlib import Path
import sqlalchemy
from nathlon.selection.config import read_config

def dying(config, event, which, fatal):
    stage, left = stages[0], which
    def note(now, *_):
        nonlocal stage
        stage = now
    def count(*_):
        nonlocal left
        left -= stage == fatal
        if left == 0:
            dies()
    sqlalchemy.event.listen(sqlalchemy.Engine, event, count)
    nightly(config, 1, note)

folder, stages = Path(sys.argv[1]), sys.argv[2:]
config = read_config(folder / "nathlon.toml")
for fatal in stages:
    for event, which in (("commit", 4), ("before_cursor_execute", 1), ("before_cursor_execute", 4)):
        assert is_killed(lambda: dying(config, event, which, fatal)), (event, which, fatal)
"""
)


def test_a_night_killed_in_every_stage_ends_as_if_nothing_had_happened(
    tmp_path: Path, folder: Path, nights: list[Night]
) -> None:
    """At a commit, at the first statement and at a later one of each; what they leave behind adds up."""
    watch_two(tmp_path)
    stages = ("opening", KERNELS, *STAGES, RECORDINGS)
    done = forked.run("-c", KILLED, tmp_path, *stages, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    run(tmp_path)
    assert outcome(tmp_path)["runs"]["night-0001"] == outcome(folder)["runs"]["night-0001"]


def test_a_clock_that_jumps_changes_nothing(
    tmp_path: Path, folder: Path, nights: list[Night], monkeypatch: pytest.MonkeyPatch
) -> None:
    watch_two(tmp_path)
    clock = Jumping(monkeypatch)
    assert run(tmp_path).name == "night-0001"
    assert run(tmp_path).reason == "Nothing is new."
    assert clock.reads > 10
    assert outcome(tmp_path)["runs"]["night-0001"] == outcome(folder)["runs"]["night-0001"]


def test_two_at_once_share_a_night(tmp_path: Path, folder: Path, nights: list[Night]) -> None:
    """It is told by one of them."""
    watch_two(tmp_path, SMALL + NOBODY_LISTENS)
    delivered = []
    for process in [forked.start("nightly", "--workers", "1", "--json", cwd=tmp_path) for _ in "ab"]:
        told, said = process.communicate()
        assert process.returncode == 0, said
        delivered += json.loads(told)["delivered"]
    assert [one["sink"] for one in delivered] == ["webhook"]
    shared, alone = (outcome(each)["runs"]["night-0001"] for each in (tmp_path, folder))
    reason = shared["facts"]["outcome"]["reason"].partition(" Not delivered")[0]
    shared["facts"]["outcome"]["reason"] = reason
    # Both may have put the same ballots in.
    assert shared | {"committee": None} == alone | {"committee": None}


def test_init_writes_what_is_the_standard(tmp_path: Path) -> None:
    result = nathlon("init", cwd=tmp_path)
    assert result.returncode == 0
    assert (tmp_path / "nathlon.toml").read_bytes() == TEMPLATE.read_bytes()
    paths = {"checkpoints", "store", "out"}
    written = read_config(tmp_path / "nathlon.toml").model_dump(exclude=paths)
    assert written == Config().model_dump(exclude=paths)
    refused(nathlon("init", cwd=tmp_path), "nathlon.toml", "exists already")


def test_bad_configurations_are_one_sentence(tmp_path: Path) -> None:
    refused(nathlon("nightly", cwd=tmp_path), "nathlon.toml", "cannot read the configuration file")
    (tmp_path / "nathlon.toml").write_text("[tournament]\nformats = 3\n")
    refused(nathlon("nightly", cwd=tmp_path), "nathlon.toml", "tournament.formats")
    (tmp_path / "nathlon.toml").write_text('checkpoints = ["nowhere"]\n')
    refused(nathlon("nightly", cwd=tmp_path), "nowhere: no such file or folder")


def test_a_newcomer_that_could_not_be_judged_has_one_more_night(tmp_path: Path) -> None:
    (tmp_path / "checkpoints").mkdir()
    source = str(shutil.copy(WEAK, tmp_path / "checkpoints"))
    config = Config(checkpoints=(str(tmp_path / "checkpoints"),))
    entrant = Entrant(policy_id(source), "weak", source, "qr-sac", "lindenring", "gt3", 1, 1)
    plan = {"world": {}, "field": asdict(EntryList((entrant,)))}
    with Store(tmp_path / "store.sqlite") as store:
        for night, waiting in (("night-0001", 1), ("night-0002", 0)):
            assert awaited(config, store)[0] == 1
            store.begin_run(night, plan)
            store.put_fact(night, NOT_JUDGED, [entrant.id])
            store.end_run(night, DONE)
            assert awaited(config, store)[0] == waiting


@pytest.fixture(scope="module")
def packed(folder: Path, nights: list[Night]) -> Path:
    """The first night in a file, signed."""
    key = folder / "key"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "ann", "-f", key], check=True)
    (folder / "signers").write_text(f"ann@example.org {key.with_suffix('.pub').read_text()}")
    out = folder / "night.nathlon.zip"
    with Store.open(folder / "nathlon.sqlite") as store:
        pack_run(folder / "nights" / "night-0001", store, out, key)
    return out


def looked_into(pack: Path, signers: Path | None = None, sample: int = 2) -> Verification:
    with Pool(1) as pool:
        return verify_pack(pack, sample, 1, signers, pool, lambda *_: None)


def test_a_packed_night_is_verified_by_racing_again(packed: Path, folder: Path) -> None:
    found = looked_into(packed, folder / "signers")
    assert (found.run, found.signed_by, found.faults) == ("night-0001", "ann@example.org", ())
    assert found.again == min(2, found.matches) > 0
    unknown = looked_into(packed, sample=0)
    assert unknown.signed_by is not None
    assert unknown.signed_by.startswith("the key SHA256:")
    with zipfile.ZipFile(packed) as archive:
        names = set(archive.namelist())
    assert {"summary.json", "report/index.html", "races/final.mcap", "matches.json"} <= names
    [sent] = read_summary(folder / "nights" / "night-0001" / "summary.json").sent
    assert f"checkpoints/{sent.entrant}.safetensors" in names


def test_what_was_changed_in_a_pack_is_found(packed: Path, tmp_path: Path) -> None:
    def other_report(files: dict[str, Any]) -> None:
        files["report/index.html"] += b"<p>changed</p>"

    def other_points(files: dict[str, Any]) -> None:
        summary = json.loads(files["summary.json"])
        summary["ranking"][0]["points_per_race"] += 1.0
        files["summary.json"] = json.dumps(summary).encode()

    def other_results(files: dict[str, Any]) -> None:
        matches = json.loads(files["matches.json"])
        for match in matches:
            match["results"]["distance_m"] = [one + 1.0 for one in match["results"]["distance_m"]]
        files["matches.json"] = json.dumps(matches).encode()

    def other_world(files: dict[str, Any]) -> None:
        matches = json.loads(files["matches.json"])
        matches[0]["spec"]["world"] = "evil.py:world"
        text = json.dumps(matches[0]["spec"], sort_keys=True)
        matches[0]["key"] = key = hashlib.sha256(text.encode()).hexdigest()
        matches[0]["results"]["match"] = [key] * len(matches[0]["results"]["match"])
        files["matches.json"] = json.dumps(matches).encode()

    with pytest.raises(InputError, match=r"report/index\.html was changed"):
        looked_into(repacked(packed, tmp_path / "1.zip", other_report, honest=False))
    assert looked_into(repacked(packed, tmp_path / "2.zip", other_report), sample=0).signed_by is None
    [fault] = looked_into(repacked(packed, tmp_path / "3.zip", other_points), sample=0).faults
    assert fault.endswith("do not follow from its races.")
    found = looked_into(repacked(packed, tmp_path / "4.zip", other_results), sample=1)
    assert found.again == 0
    assert "ended otherwise when it was run again" in found.faults[0]
    with pytest.raises(InputError, match=r"raced in 'evil\.py:world', which is code"):
        looked_into(repacked(packed, tmp_path / "5.zip", other_world))
    (tmp_path / "6.zip").write_bytes(b"no zip")
    with pytest.raises(InputError, match="not a packed run"):
        looked_into(tmp_path / "6.zip")


def test_a_pack_of_somebody_else_is_refused(packed: Path, folder: Path, tmp_path: Path) -> None:
    nobody = tmp_path / "signers"
    nobody.write_text("")
    with pytest.raises(InputError, match="the signer is not in"):
        looked_into(packed, nobody)
    with pytest.raises(InputError, match="is not signed, expected a signature of somebody in"):
        looked_into(repacked(packed, tmp_path / "1.zip", lambda files: None), folder / "signers")

    def signed_by_another(files: dict[str, Any]) -> None:
        manifest = json.loads(files["manifest.json"])
        files["manifest.json"] = json.dumps(manifest | {"run": "night-0009"}).encode()

    with pytest.raises(InputError, match="the signature is not of this pack"):
        looked_into(repacked(packed, tmp_path / "2.zip", signed_by_another, honest=False))

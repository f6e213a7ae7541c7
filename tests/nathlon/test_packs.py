"""Packs: what is packed, and what is found without racing anything again."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from nathlon.arena.entrant import Entrant, entrants_table
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.arena.store.matches import Finished
from nathlon.lab.pack import packing
from nathlon.lab.pack.packing import pack_run
from nathlon.lab.pack.verifying import Verification, verify_pack
from nathlon.policies.sources.identity import policy_id
from nathlon.results.standing import ranked
from nathlon.results.summary import SetAside, read_summary, write_summary
from nathlon.selection import run as run_module
from nathlon.selection.run import Run
from nathlon.sim.errors import InputError
from nathlon.tournament.points import rank
from tests.support.checkpoints import BUNDLED
from tests.support.packs import repacked
from tests.support.race_results import duels
from tests.support.selections import with_tables

SOURCES = ("driver:pace=0.9", *map(str, BUNDLED[:2]))
IDS = tuple(map(policy_id, SOURCES))


@pytest.fixture(scope="module")
def finished() -> list[Finished]:
    """A round robin of three entrants, whose results are invented."""
    listed = []
    for home, away in ((0, 1), (0, 2), (1, 2)):
        races = tuple(
            Race(seed, (Seat(side, side), Seat(1 - side, 1 - side)), bool(side))
            for seed in (1, 2)
            for side in (0, 1)
        )
        entrants, sources = (IDS[home], IDS[away]), (SOURCES[home], SOURCES[away])
        match = Match("tournament", "duel", "slipstream_pass", "lindenring", "gt3", entrants, sources, races)
        results = duels({entrants: [1.0 + home, 2.0]}).with_columns(
            match=pl.lit(match.key), test=pl.lit("duel")
        )
        car = pl.int_range(pl.len()) % 2
        results = results.with_columns(car=car.cast(pl.Int64), slot=car.cast(pl.Int64) + 1)
        listed.append(Finished(match.key, "tournament", match.spec(), results, None))
    return listed


@pytest.fixture
def store(tmp_path: Path, finished: list[Finished]) -> Iterator[Store]:
    entrants = [
        Entrant(identity, f"e{number}", source, "QR-SAC", "lindenring", "gt3", 1, 1)
        for number, (identity, source) in enumerate(zip(IDS, SOURCES, strict=True))
    ]
    names = {entrant.id: entrant.name for entrant in entrants}
    results = pl.concat([match.results for match in finished])
    ranking = ranked(rank(results, np.random.default_rng(1), resamples=2), names)
    summary = with_tables({}).summary.model_copy(update={"ranking": ranking, "replays": ()})
    (tmp_path / "night-0001" / "report").mkdir(parents=True)
    (tmp_path / "night-0001" / "report" / "index.html").write_text("<p>the report</p>")
    write_summary(tmp_path / "night-0001" / "summary.json", summary)
    with Store(tmp_path / "store.sqlite") as store:
        for name, told in (
            ("night-0001", summary),
            ("night-0002", summary.model_copy(update={"ranking": ()})),
        ):
            store.begin_run(name, {})
            store.put_fact(name, "summary", told.model_dump(mode="json"))
        store.put_table("night-0001", "entrants", entrants_table(entrants))
        store.add_matches(finished)
        store.use("night-0001", [match.key for match in finished])
        yield store


@pytest.fixture
def night(store: Store, tmp_path: Path) -> Path:
    return tmp_path / "night-0001"


class Nobody:
    """Races nothing, and notes what was asked for."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def record(self, wanted: Iterable[Wanted]) -> Iterator[tuple[Match, Any]]:
        self.asked += [one.match.key for one in wanted]
        return iter(())


def looked_into(pack: Path, sample: int = 0, drawn: list[str] | None = None) -> Verification:
    nobody: Any = Nobody()
    found = verify_pack(pack, sample, 1, None, nobody, lambda *_: None)
    if drawn is not None:
        drawn += nobody.asked
    return found


def test_who_was_gone_when_a_run_was_decided_is_named(night: Path, store: Store, tmp_path: Path) -> None:
    rows = store.table("night-0001", "entrants")
    lost = str(tmp_path / "lost.safetensors")
    store.put_table(
        "night-0001", "entrants", rows.with_columns(source=pl.col("source").replace(SOURCES[1], lost))
    )
    with pytest.raises(InputError, match=r"lost\.safetensors: is gone or has changed"):
        pack_run(night, store, tmp_path / "run.zip")
    summary = read_summary(night / "summary.json")
    gone = SetAside(source=lost, reason="is gone", digest=IDS[1])
    write_summary(night / "summary.json", summary.model_copy(update={"gone": (gone,)}))
    pack_run(night, store, packed := tmp_path / "run.zip")
    drawn: list[str] = []
    found = looked_into(packed, 3, drawn)
    assert (found.missing, found.faults, found.matches, len(drawn)) == (("e1",), (), 3, 1)

    def not_said(files: dict[str, Any]) -> None:
        files["summary.json"] = json.dumps(json.loads(files["summary.json"]) | {"gone": []}).encode()

    with pytest.raises(InputError, match="is not in it, expected the checkpoint of an entrant"):
        looked_into(repacked(packed, tmp_path / "1.zip", not_said))


def test_a_run_leaves_the_matches_of_those_that_were_set_aside(
    finished: list[Finished], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their files go when all have raced: ranking and pack rest on the races of the others alone."""
    monkeypatch.setattr(run_module, "intact", lambda _, left: [one.id != IDS[2] for one in left])
    matches = [Match.from_spec(one.spec, dict(zip(IDS, SOURCES, strict=True))) for one in finished]
    entrants = [
        Entrant(one, one[:6], source, "", "", "", 1, 1) for one, source in zip(IDS, SOURCES, strict=True)
    ]
    with Store(tmp_path / "store.sqlite") as store, Pool(1) as pool:
        store.begin_run("night-0001", {})
        store.add_matches(finished)
        run = Run(store, "night-0001", (1,), pool, lambda *_: None)

        def hold(left: list[Entrant]) -> pl.DataFrame:
            there = {entrant.id for entrant in left}
            results = run.results("tournament", [one for one in matches if there.issuperset(one.entrants)])
            if len(left) == 3:
                raise InputError("a file is gone")
            return results

        held = run.with_those_there(entrants, hold)
        assert set(run.gone) == {IDS[2]}
        assert set(held["match"]) == set(store.results_of_run("night-0001")["match"]) == {finished[0].key}
        assert store.stored([one.key for one in finished]) == {one.key for one in finished}


def test_a_pack_that_tells_half_of_it_is_found(night: Path, store: Store, tmp_path: Path) -> None:
    """None of these is found by racing again: the sample, even of all matches, comes to the same."""

    pack_run(night, store, packed := tmp_path / "run.zip")
    assert looked_into(packed).faults == ()

    def without_the_best(files: dict[str, Any]) -> None:
        summary = json.loads(files["summary.json"])
        del summary["ranking"][0]
        files["summary.json"] = json.dumps(summary).encode()

    def matches(change: Callable[[list[Any]], Any]) -> Callable[[dict[str, Any]], None]:
        def changed(files: dict[str, Any]) -> None:
            listed = json.loads(files["matches.json"])
            change(listed)
            files["matches.json"] = json.dumps(listed).encode()

        return changed

    def no_stage(listed: list[Any]) -> None:
        listed[0]["spec"]["stage"] = []
        text = json.dumps(listed[0]["spec"], sort_keys=True)
        listed[0]["key"] = hashlib.sha256(text.encode()).hexdigest()

    def a_bare_specification(listed: list[Any]) -> None:
        listed[0]["spec"] = {"world": "racing", "stage": "tournament"}
        text = json.dumps(listed[0]["spec"], sort_keys=True)
        listed[0]["key"] = hashlib.sha256(text.encode()).hexdigest()

    [fault] = looked_into(repacked(packed, tmp_path / "0.zip", without_the_best)).faults
    assert fault.endswith("has raced and is not in the ranking.")
    for change, said in (
        (matches(lambda listed: listed.append(listed[0])), "holds a match twice"),
        (
            matches(lambda listed: listed[0]["results"].update(match=listed[1]["results"]["match"])),
            "every row",
        ),
        (matches(a_bare_specification), "its matches cannot be read"),
        (matches(no_stage), "its matches cannot be read"),
        (matches(lambda listed: listed[0]["results"].update(points=[10**400] * 8)), "cannot be read"),
        (lambda files: files.update({"entrants.json": b"[" * 100_000}), "its matches cannot be read"),
        (lambda files: files.update({"a": b"", "a/b": b""}), r"'a/b' cannot be unpacked"),
        (lambda files: files.update({"a" * 300: b""}), "cannot be unpacked: File name too long"),
    ):
        with pytest.raises(InputError, match=said):
            looked_into(repacked(packed, tmp_path / "1.zip", change))
    strange = matches(lambda listed: listed[0]["results"].update(entrant=[None] * 8))
    assert looked_into(repacked(packed, tmp_path / "2.zip", strange)).faults


def test_a_pack_is_of_the_run_of_its_folder_and_no_larger_than_is_read(
    night: Path, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run.zip"
    shutil.copytree(night, tmp_path / "renamed")
    assert pack_run(tmp_path / "renamed", store, out).run == "night-0001"
    summary = json.loads((night / "summary.json").read_text())
    for change, said in (
        ({"ranking": summary["ranking"][:1]}, "holds no run with the ranking of"),
        (
            {"replays": [{"match": "a", "race": 0, "why": "", "recording": "../../x.mcap"}]},
            "not in its folder",
        ),
    ):
        (tmp_path / "renamed" / "summary.json").write_text(json.dumps(summary | change))
        with pytest.raises(InputError, match=said):
            pack_run(tmp_path / "renamed", store, out)
    planner = store.table("night-0001", "entrants").with_columns(source=pl.lit("mppi:a.safetensors"))
    with monkeypatch.context() as patched:
        patched.setattr(Store, "table", lambda self, run, name: planner)
        with pytest.raises(InputError, match=r"mppi:a\.safetensors: cannot be packed"):
            pack_run(night, store, out)
    monkeypatch.setattr(packing, "MOST_MIB", packing.SPARE_MIB)
    with pytest.raises(InputError, match="MiB with its checkpoints, expected at most"):
        pack_run(night, store, out)
    (tmp_path / "renamed" / "summary.json").write_text(json.dumps(summary))
    (tmp_path / "renamed" / "report" / "my notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"my notes\.txt: expected a name of letters"):
        pack_run(tmp_path / "renamed", store, out)

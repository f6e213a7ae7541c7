"""Checkpoints in a store: what is needed stays, and what nobody needs any more can be removed."""

from __future__ import annotations

import hashlib
import json
from datetime import UTC, datetime, timedelta

import pytest
import sqlalchemy as sa

from nathlon.arena.store import Queued, Store, opening
from nathlon.arena.store.database import stamp
from tests.support.command_line import nathlon

pytest_plugins = ["tests.support.databases"]

DAY_S = 86_400.0
CONTENTS = (b"wanted", b"left over", b"asked for", b"new")
WANTED, LEFT_OVER, ASKED_FOR, NEW = (hashlib.sha256(content).hexdigest() for content in CONTENTS)


def change(target: str, *statements: str, **values: str | bytes) -> None:
    engine = sa.create_engine(target if "://" in target else f"sqlite:///{target}")
    with engine.begin() as connection:
        for statement in statements:
            connection.execute(sa.text(statement), values)
    engine.dispose()


def age(target: str, days: float) -> None:
    """Have all files of a store been used so long ago."""
    change(target, "UPDATE file SET used_at = :at", at=stamp(datetime.now(UTC) - timedelta(days=days)))


def fill(store: Store, target: str) -> None:
    """Four files of which one is wanted, one has been asked for since, and one is new."""
    for digest, content in zip((WANTED, LEFT_OVER, ASKED_FOR), CONTENTS, strict=False):
        store.put_file(digest, content)
    age(target, 10)
    store.put_file(NEW, CONTENTS[-1])
    assert store.files([ASKED_FOR, "0" * 64]) == {ASKED_FOR}
    store.enqueue([Queued("match", "here", {"entrants": [WANTED, "driver"]}, [])], {"here": {}})


def test_what_is_wanted_or_was_used_of_late_stays(target: str) -> None:
    with Store(target) as store:
        fill(store, target)
        everything = {WANTED, LEFT_OVER, ASKED_FOR, NEW}
        assert store.remove_files(11 * DAY_S) == (0, 0)
        assert store.files(everything - {LEFT_OVER}) == everything - {LEFT_OVER}
        assert store.remove_files(9 * DAY_S) == (1, len(b"left over"))
        with pytest.raises(KeyError):
            store.file(LEFT_OVER)
        age(target, 10)
        assert store.remove_files(9 * DAY_S) == (2, len(b"asked for") + len(b"new"))
        assert store.file(WANTED) == b"wanted"
        store.withdraw(["match"])
        assert store.remove_files(9 * DAY_S) == (1, len(b"wanted"))
        assert store.files(everything) == set()
        store.put_file(WANTED, b"wanted")
        assert store.file(WANTED) == b"wanted", "what is wanted again comes again"


def test_the_command_says_what_it_has_removed(target: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("commands")
    with Store(target) as store:
        fill(store, target)
    kept = nathlon("store", "clean", target, "--days", "11", "--json", cwd=folder)
    assert json.loads(kept.stdout)["removed"] == 0
    done = nathlon("store", "clean", target, "--days", "9", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["removed"], told["bytes"]) == (1, len(b"left over"))
    if "://" not in target:
        missing = nathlon("store", "clean", str(folder / "gone.sqlite"), cwd=folder)
        assert missing.returncode == 2
        assert not (folder / "gone.sqlite").exists()
        assert nathlon("store", "clean", target, "--days", "0", cwd=folder).returncode == 2


def test_files_of_an_older_store_count_as_used_when_it_was_brought_up_to_date(target: str) -> None:
    Store(target).close()
    change(
        target,
        "ALTER TABLE result DROP COLUMN stints",
        "ALTER TABLE file DROP COLUMN used_at",
        *(f"ALTER TABLE worker DROP COLUMN {later}" for later in ("began_at", "seen_at", "ran")),
        f"UPDATE {opening.VERSION_TABLE} SET version_num = '0005'",
        "INSERT INTO file (digest, content) VALUES (:digest, :content)",
        digest=LEFT_OVER,
        content=b"left over",
    )
    with Store(target) as store:
        assert store.remove_files(DAY_S) == (0, 0)
        age(target, 2)
        assert store.remove_files(DAY_S) == (1, len(b"left over"))

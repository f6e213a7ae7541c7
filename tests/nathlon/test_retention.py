"""Old nights lose what the store makes again, and nothing else."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from pydantic import ValidationError

from nathlon.arena.store import Store
from nathlon.selection.config import Config, NightlySettings
from nathlon.selection.nightly.retention import thin_out


def contents(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_only_old_nights_that_were_told_are_thinned_out(tmp_path: Path) -> None:
    out = tmp_path / "nights"
    stays = ["drives", "minutes.txt", "sent", "summary.json"]
    whole = sorted([*stays, "policies.log", "races", "report"])
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "film.mcap").touch()
    with Store(tmp_path / "store.sqlite") as store:
        for number in range(1, 5):
            name = f"night-{number:04d}"
            for part in ("races", "report", "sent", "drives"):
                (out / name / part).mkdir(parents=True)
            (out / name / "races" / "linked").symlink_to(outside)
            for part in ("summary.json", "policies.log", "sent/best.onnx", "minutes.txt"):
                (out / name / part).touch()
            store.begin_run(name, {})
            if number != 3:
                store.end_run(name, "done")
            store.put_fact(name, "outcome", {"code": 0, "reason": "", "told": number != 2})
        nights = store.runs()
        soon, late = (datetime.now(UTC) + timedelta(days=days) for days in (89, 91))
        assert thin_out(store, nights, out, 90, soon) == []
        assert thin_out(store, nights, out, 90, late) == [out / "night-0001"]
        assert thin_out(store, nights, out, 90, late) == []
    assert contents(out / "night-0001") == stays
    assert contents(out / "night-0001" / "sent") == ["best.onnx"]
    # Not told yet, not ended, and the last one.
    assert [contents(out / f"night-000{number}") for number in (2, 3, 4)] == [whole] * 3
    assert contents(outside) == ["film.mcap"]


def test_how_long_nights_are_kept_changes_no_night() -> None:
    kept = Config(nightly=NightlySettings(keep="90 days"))
    assert kept.nightly.keep_days == 90
    assert kept.digest == Config().digest
    for wrong in ("90", "0 days", "3 months", "-1 days"):
        with pytest.raises(ValidationError, match="keep"):
            NightlySettings(keep=wrong)

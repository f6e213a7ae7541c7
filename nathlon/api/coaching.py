"""`nathlon.coach`: where a car of a recorded race lost time and why, and what is faster."""

from __future__ import annotations

from functools import partial
from html import escape
from pathlib import Path

import polars as pl

from nathlon.arena.pool import Pool
from nathlon.arena.recording import read_recording
from nathlon.coaching.coach import Coach, Coached
from nathlon.coaching.reference import CHAMPION, reference
from nathlon.coaching.words import tell
from nathlon.progress import stage_progress
from nathlon.reports.cars import car_index
from nathlon.reports.coach import CoachFacts
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import whole_file

SECTIONS = "sections"
"""What progress counts."""


class CoachResult:
    """What the coach has found, and where it is.

    Attributes:
        folder: of all that it has left.
        facts: all of it; `nathlon.reports.coach.CoachFacts`.
        facts_file: the same as JSON, for other programs.
        text: in sentences.
        text_file: the same as a file (.txt).
    """

    def __init__(self, folder: Path, facts: CoachFacts, text: str) -> None:
        self.folder, self.facts, self.text = folder, facts, text
        self.facts_file, self.text_file = folder / "coach.json", folder / "coach.txt"

    @property
    def sections(self) -> pl.DataFrame:
        """A row for each section: its `name`, `kind`, `time_s`, `other_s` and `lost_s`."""
        columns = ("name", "kind", "time_s", "other_s", "lost_s")
        return pl.DataFrame([{name: getattr(one, name) for name in columns} for one in self.facts.sections])

    @property
    def advice(self) -> pl.DataFrame:
        """A row for each advice, the greatest gain first; the fields of `nathlon.reports.coach.Advice`."""
        return pl.DataFrame([one.model_dump() for one in self.facts.advice])

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text)}</pre>"


def coach(
    recording: str | Path,
    *,
    car: int | str,
    against: str | Path = CHAMPION,
    out: str | Path = "runs/coach",
    progress: bool = True,
) -> CoachResult:
    """Say where a car of a recorded race lost time and why, and what is faster, driven again to prove it.

    Args:
        recording: of the race (.mcap).
        car: number or name of the car, of whose laps the best is coached.
        against: `champion`, `limit`, or the recording of another race.
        out: folder for what it leaves.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if a recording cannot be read, the car has completed no lap, there is no lap to compare it
            with, or the folder cannot be written.
    """
    path, folder = Path(recording), Path(out)
    log = read_recording(path)
    index = car_index(log, str(car), path)
    with Pool(1) as pool, stage_progress(progress, (SECTIONS,)) as on_match:
        work = Coach(log, index, reference(pool, log, str(against)))
        coached = work.work(partial(on_match, SECTIONS))
    return _write(folder, coached)


def _write(folder: Path, coached: Coached) -> CoachResult:
    result = CoachResult(folder, coached.facts, tell(coached.facts))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(result.facts_file) as partial_file:
            partial_file.write_text(coached.facts.model_dump_json(indent=1) + "\n", "utf-8")
        with whole_file(result.text_file) as partial_file:
            partial_file.write_text(result.text, "utf-8")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}") from None
    return result

"""`nathlon.coach`: where a car of a recorded race lost time and why, and what is faster."""

from __future__ import annotations

import json
from functools import partial
from html import escape
from pathlib import Path

import numpy as np
import polars as pl

from nathlon.arena.pool import Pool
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording
from nathlon.lab.coach.coach import Coach, CoachedRace
from nathlon.lab.coach.lap import STEP_M, Lap
from nathlon.lab.coach.phrasing import Phrased
from nathlon.lab.coach.phrasing import phrase as phrased_by
from nathlon.lab.coach.reference import CHAMPION, reference
from nathlon.lab.coach.words import tell, told_advice, told_causes, told_gain, told_unproved
from nathlon.lab.llm.chat import Endpoint
from nathlon.reports.cars import car_index
from nathlon.reports.coach_page import CoachDrawing, Sentences, Traces, write_coach_page
from nathlon.results.coach import CoachFacts
from nathlon.sim.whole_file import check_output, write_whole, writing
from nathlon.terminal.progress import stage_progress

PHRASING = "phrasing.json"
"""What a language model said, and why it was refused."""
DRIVES = "drives"
"""What progress counts."""


class CoachResult:
    """What the coach has found, and where it is.

    Attributes:
        folder: of all that it has left.
        facts: all of it; `nathlon.results.coach.CoachFacts`.
        facts_file: the same as JSON, for other programs.
        text: in sentences.
        text_file: the same as a file (.txt).
        page: map, traces, clips and words (.html).
        refused: what a language model said that is not in the facts, if that is why the sentences are the
            coach's own; empty otherwise.
        unasked: why the language model could not be asked, if that is why; empty otherwise.
    """

    def __init__(self, folder: Path, facts: CoachFacts, text: str, phrased: Phrased | None = None) -> None:
        self.folder, self.facts, self.text = folder, facts, text
        self.refused, self.unasked = tuple[str, ...](), "" if phrased is None else phrased.unasked
        if phrased is not None and phrased.text is None and not phrased.unasked:
            self.refused = tuple(phrased.attempts[-1].refused)
        self.facts_file, self.text_file = folder / "coach.json", folder / "coach.txt"
        self.page = folder / "index.html"

    @property
    def sections(self) -> pl.DataFrame:
        """A row for each section: its `name`, `kind`, `time_s`, `other_s` and `lost_s`."""
        columns = ("name", "kind", "time_s", "other_s", "lost_s")
        return pl.DataFrame([{name: getattr(one, name) for name in columns} for one in self.facts.sections])

    @property
    def advice(self) -> pl.DataFrame:
        """A row for each advice, the greatest gain first; the fields of `nathlon.results.coach.Advice`."""
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
    phrase: bool = False,
    progress: bool = True,
) -> CoachResult:
    """Say where a car of a recorded race lost time and why, and what is faster, driven again to prove it.

    Args:
        recording: of the race (.mcap).
        car: number or name of the car, of whose laps the best is coached.
        against: `champion`, `limit`, or the recording of another race.
        out: folder for what it leaves.
        phrase: whether a language model is to phrase the sentences: the one that the environment names by
            `NATHLON_MODEL_URL`, `NATHLON_MODEL` and `NATHLON_MODEL_KEY`. What is not in the facts is refused;
            where it cannot be asked the sentences are the coach's own.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if a recording cannot be read, the car has completed no lap, there is no lap to compare it
            with, or the folder cannot be written; if no model is named that could phrase it.
    """
    endpoint = Endpoint.from_environment() if phrase else None
    path, folder = Path(recording), Path(out)
    check_output(folder)
    log = read_recording(path)
    index = car_index(log, str(car), path)
    with Pool(1) as pool, stage_progress(progress, (DRIVES,)) as on_match:
        work = Coach(log, index, reference(pool, log, str(against)))
        coached = work.work(partial(on_match, DRIVES))
    notes = tell(coached.facts)
    phrased = phrased_by(coached.facts, notes, endpoint) if endpoint else None
    return _write(folder, log, coached, notes, phrased)


def _write(
    folder: Path, log: RaceLog, coached: CoachedRace, notes: str, phrased: Phrased | None
) -> CoachResult:
    result = CoachResult(folder, coached.facts, notes if phrased is None else phrased.text or notes, phrased)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(result.facts_file, coached.facts.model_dump_json(indent=1) + "\n")
        write_whole(result.text_file, result.text)
        if phrased is not None:
            said = [attempt.model_dump() for attempt in phrased.attempts]
            write_whole(folder / PHRASING, json.dumps(said, indent=1, ensure_ascii=False) + "\n")
        write_coach_page(_drawing(log, coached, result.text), result.page)
    return result


def _drawing(log: RaceLog, coached: CoachedRace, text: str) -> CoachDrawing:
    facts = coached.facts
    sentences = Sentences(
        causes=tuple(told_causes(section) for section in facts.sections),
        advice=tuple(
            (_begun(told_advice(one, facts.other)), _begun(told_gain(one, facts.sections)))
            for one in facts.advice
        ),
        unproved=tuple(told_unproved(facts)),
        text=text,
    )
    edited = tuple(
        Traces(one.places, one.time_s, one.speed, one.pedal, one.lateral) for _, one in coached.drives
    )
    return CoachDrawing(log, facts, sentences, _traces(coached.lap), _traces(coached.other), edited)


def _begun(phrase: str) -> str:
    """A phrase as a sentence begins."""
    return phrase[:1].upper() + phrase[1:]


def _traces(lap: Lap) -> Traces:
    places = np.arange(len(lap.time_s)).astype(np.float64) * STEP_M
    return Traces(places, lap.time_s, lap.speed, lap.pedal, lap.lateral)

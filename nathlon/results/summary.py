"""What a selection came to, as `summary.json` says it to other programs."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from nathlon.arena.world_finding import RACING
from nathlon.results.forecast import Forecast
from nathlon.results.part import ResultModel
from nathlon.results.standing import ActionTime, Crossed, Ranked, timed_on
from nathlon.results.voided import MostVoid, Voided, void_runs
from nathlon.results.words import an_episode, episodes
from nathlon.sim.errors import InputError
from nathlon.sim.validation import read_json
from nathlon.sim.whole_file import write_whole

VERSION = 1
"""Of `summary.json`: raised when a field goes or changes its meaning, not when one is added."""
PACKAGES = ("nathlon", "numpy", "numba")


class Stage(ResultModel):
    """A stage that has ended: `pareto`, `battery`, `committee` or `tournament`.

    Attributes:
        entered, left: entrants that came in, and that went on.
        races: that it rests on, void ones included.
        void: races that count for nobody.
        wall_s: how long it took, s.
        ran: races that it ran itself; the others were in the store already.
        core_s: processor time for which it held its workers, s.
    """

    name: str
    entered: Annotated[int, Field(alias="in")]
    left: Annotated[int, Field(alias="out")]
    races: int
    wall_s: float
    ran: int = 0
    core_s: float = 0.0
    void: int = 0


class Sent(ResultModel):
    """An entrant that the committee sends.

    Attributes:
        name, entrant: its name, and its id.
        path: of its copy, from the folder of `summary.json`; None of what is no file.
        digest: SHA-256 of the copy, in hexadecimal.
    """

    name: str
    entrant: str
    path: str | None = None
    digest: str | None = None


class CandidateStanding(ResultModel):
    """How a candidate stands; see `nathlon.selection.committee.events.Standing`."""

    name: str
    entrant: str
    approved_by: int
    fit: bool
    favour: float
    chosen: bool


class Decided(ResultModel):
    """A question to the committee, what was said, and what followed or, while it is open, would follow now.

    Attributes:
        decision: its name in the event log.
        question: `shortlist` or `selection`.
        seats: entrants to choose.
        waits_for: ballots of people that are missing.
        evidence: digest, rows and tables that the members were shown.
        said: events of the log that count, as plain values.
        drives: test drives against candidates under letters, likewise.
        late: numbers of those that came too late for the result.
        ballots: cast.
        agreement: of the members, from -1 to 1; None with fewer than two.
        standings: candidates from first to last.
    """

    decision: str
    question: str
    seats: int
    open: bool
    waits_for: int
    evidence: dict[str, Any]
    said: tuple[dict[str, Any], ...]
    late: tuple[int, ...]
    ballots: int
    agreement: float | None
    standings: tuple[CandidateStanding, ...]
    drives: tuple[dict[str, Any], ...] = ()


class TestMarks(ResultModel):
    """What is worth 500 points in a test (`base`) and 1,000 (`reference`), in the test's unit.

    Attributes:
        asks: what the test asks, for people.
        stretch_m: where it begins and ends, from the line; None for whole laps, or where that is not known.
        failed: by entrant's id, how many of its runs set no mark, where any did; None if that was not kept.
    """

    base: float
    reference: float
    asks: str = ""
    stretch_m: tuple[float, float] | None = None
    failed: dict[str, int] | None = None


@dataclass(frozen=True)
class SetAside:
    """A file or plugin that was set aside, and why.

    Attributes:
        digest: its id as far as it can be known without opening it; None where it cannot be read.
    """

    source: str
    reason: str
    digest: str | None = None

    @property
    def key(self) -> str:
        """By which it is known again as long as it has not changed."""
        return self.digest or self.source


@dataclass(frozen=True)
class Clip:
    """A part of a race, s since its start; the car to follow, and why one should look at it."""

    start_s: float
    end_s: float
    car: int
    why: str


class Replay(ResultModel):
    """A race to look at.

    Attributes:
        match, race: its match's key and its number there.
        why: one should look at it.
        recording, player, replay: paths from the report's folder; None where there is none.
        clips: its decisive moments.
        missing: why it was not run again; None where it was.
        video: of an episode of another world; path from the report's folder.
        seats: of that episode by their names, and who had them.
        notes: what is to be said of recording and video, in sentences.
    """

    match: str
    race: int
    why: str
    recording: str | None = None
    player: str | None = None
    replay: str | None = None
    clips: tuple[Clip, ...] = ()
    missing: str | None = None
    video: str | None = None
    seats: dict[str, str] = Field(default_factory=dict)
    notes: tuple[str, ...] = ()


class Summary(ResultModel):
    """What a selection came to.

    Attributes:
        version: of this format.
        stages: that have ended.
        ranking: of the round robin, best first.
        sent: whom the committee sends; empty where it sends nobody or has not decided.
        seed: of all randomness; None where the run has not come so far.
        world: simulator in which everything was played.
        episode: what its users call one.
        brings: what one brings: "points", by place or of a team, or the "score".
        circuit, car: what was driven; empty in another world.
        versions: of Python and packages.
        pair_correlation: of the two races of a mirrored pair; None where too few tell.
        unit_deviation: of the difference of two entrants from one unit to the next, points a race; None where
            too few tell.
        effect: least true difference of two finalists, points a race, that such a round robin finds as often
            as the forecast's `power` says; None where nobody met.
        forecast: what was expected of it before it ran.
        confidence: of all intervals.
        marks: by test.
        tests_set_aside: reasons by test.
        car_runs: cars times races.
        faults, void: of them ended by a policy's fault, and by one of the simulator or the machine.
        not_judged: entrants that cannot be sent, as most of their runs are void.
        most_void: who has by far the greatest share of void races; None where nobody has.
        excluded: what was set aside before anything ran.
        gone: finalists that could not be sent, as their files had gone or changed when it was decided.
        notes: what else is to be said of the files, in sentences.
        also: other files with the same contents, by the entrant's name.
        stages_set_aside: reasons by stage.
        committee: what it was asked.
        replays: races to look at, the deciding one first.
        recording, replay: of the deciding race; paths from the report's folder.
        log: of what policies have printed, likewise; None where they have printed nothing.
        report: the page; path from the folder of `summary.json`.
        strategies: policies crossed with strategies; empty where they are not.
        action_times: what an action of each finalist costs, which is another figure on another machine.
        processors: kinds of processors that ran matches, and how many; see `nathlon.arena.processor`.
    """

    version: int = VERSION
    stages: tuple[Stage, ...]
    ranking: tuple[Ranked, ...]
    sent: tuple[Sent, ...]
    seed: int | None
    world: str = RACING
    episode: str = "race"
    brings: Literal["points", "score"] = "points"
    circuit: str
    car: str
    versions: dict[str, str]
    pair_correlation: float | None
    confidence: float
    marks: dict[str, TestMarks]
    tests_set_aside: dict[str, str]
    car_runs: int
    faults: int
    void: int
    excluded: tuple[SetAside, ...]
    gone: tuple[SetAside, ...] = ()
    notes: tuple[str, ...] = ()
    also: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    not_judged: tuple[Voided, ...] = ()
    most_void: MostVoid | None = None
    stages_set_aside: dict[str, str] = Field(default_factory=dict)
    unit_deviation: float | None = None
    effect: float | None = None
    forecast: Forecast | None = None
    committee: tuple[Decided, ...] = ()
    replays: tuple[Replay, ...] = ()
    recording: str | None = None
    replay: str | None = None
    log: str | None = None
    report: str | None = None
    strategies: tuple[Crossed, ...] = ()
    action_times: tuple[ActionTime, ...] = ()
    processors: dict[str, int] = Field(default_factory=dict)

    @property
    def void_runs(self) -> str:
        """How many runs are void, and who could not be judged for them; '' where none are."""
        told = void_runs(self.void, self.car_runs, self.not_judged)
        if self.not_judged or self.most_void is None:
            return told
        most = self.most_void
        return (
            f"{told[:-1]}, most often for {most.name}: {most.void:,} of its {most.races:,} {self.episodes}."
        )

    @property
    def timed_on(self) -> str:
        """A sentence on how actions were timed, and where; '' where none was."""
        return timed_on(self.action_times)

    @property
    def an_episode(self) -> str:
        """One, with its article."""
        return an_episode(self.episode)

    @property
    def a_mean(self) -> str:
        """What `Ranked.mean` is, as a heading."""
        return f"Mean {self.brings} {self.an_episode}"

    @property
    def episodes(self) -> str:
        """Several of them."""
        return episodes(self.episode)


def write_summary(path: Path, summary: Summary) -> None:
    """Write `summary.json`, whole or not at all."""
    write_whole(path, summary.model_dump_json(indent=1) + "\n")


def read_summary(path: Path) -> Summary:
    """Read `summary.json`.

    Raises:
        InputError: if it cannot be read, is none, or is of a later version.
    """
    try:
        summary = read_json(path.read_bytes(), Summary, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if summary.version > VERSION:
        raise InputError(f"{path}: field version is {summary.version}, expected at most {VERSION}")
    return summary


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that are there, by name."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found

"""What a worker process does: it opens policies, runs matches, and says who is asked."""

from __future__ import annotations

import logging
import os
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from multiprocessing import connection
from typing import Any

from nathlon.arena.job import Answer, Job, MatchJob, Opening, Wanted
from nathlon.arena.leg import drive_leg
from nathlon.arena.match_policies import match_policy
from nathlon.arena.output_log import print_into
from nathlon.arena.recorder import Recorded, record_races
from nathlon.arena.recording import recording_name, write_recording
from nathlon.arena.results import came_out_alike
from nathlon.arena.team import Absent
from nathlon.arena.watch import Watch
from nathlon.arena.workers import NO_MEMORY, READY
from nathlon.arena.world import LineUp
from nathlon.arena.world_finding import is_racing
from nathlon.arena.world_registry import load_world
from nathlon.policies.hosting.spawned import obey_parent
from nathlon.policies.isolation import keep_channels, preserved
from nathlon.policies.policy import Policy
from nathlon.policies.sources import DRIVER
from nathlon.sim.errors import InputError

log = logging.getLogger(__name__)


def serve(pipe: connection.Connection, watch: Watch, sink: Any) -> None:
    """Do what comes through the pipe, and send (number, answer) of each job.

    What is printed meanwhile goes into a log's `sink`.
    """
    # At Ctrl-C the parent ends its workers at once, for a match that is not finished is not stored.
    obey_parent()
    if os.name == "posix":
        os.setpgrp()  # so that it ends with all that policies fork
        os.register_at_fork(after_in_child=lambda: _fall_silent(pipe, watch))
    print_into(sink)
    if os.name == "posix":
        keep_channels(pipe.fileno())
    while True:
        pipe.send(READY)
        try:
            jobs: list[Job] = pipe.recv()
        except EOFError:
            return
        watch.begin(weighs=any(job.alone for job in jobs))
        try:
            for message in do(jobs, watch):
                watch.rest()
                pipe.send(message)
        except MemoryError:
            # At once, while the watch still says who was asked.
            os._exit(NO_MEMORY)
        except Exception:
            # Of ours, not of a policy: it is for the user to see.
            pipe.send(RuntimeError(traceback.format_exc()))
        watch.rest()


def _fall_silent(pipe: connection.Connection, watch: Watch) -> None:
    """What a policy forks has the same pipe: one of the two would be taken for the other.

    It ends where the policy does: it would run the match beside its parent, and fork again at every answer.
    """
    watch.fall_silent()
    watch._tell = lambda *_: os._exit(1)  # type: ignore[method-assign]
    with suppress(OSError):
        pipe.close()


def do(jobs: Iterable[Job], watch: Watch) -> Iterator[tuple[int, Answer]]:
    """Do jobs in this process, and yield the index of each and its answer as it ends."""
    line_ups: dict[int, LineUp] = {}
    for number, job in enumerate(jobs):
        if isinstance(job, Opening):
            _begin(job.source, number, 0, watch)
            yield number, _open(job)
            continue
        try:
            policies = [_present(job, number, entrant, watch) for entrant in range(len(job.match.entrants))]
            driven = drive_leg(job.match, policies, job.leg, watch) if job.leg else None
        except MemoryError:
            raise
        except InputError as error:
            yield number, error
            continue
        if driven:
            yield number, driven
        elif job.wanted:
            yield number, _record(job.wanted, policies, watch)
        else:
            line_ups[number] = job.match, policies
    if line_ups:
        first, _ = next(iter(line_ups.values()))
        try:
            first.check_here()
        except InputError as error:
            yield from ((number, error) for number in line_ups)
            return
        world = load_world(first.world, first.circuit, first.car)
        for number, results in world.run(line_ups, watch):
            yield number, Recorded(results, [])


def _open(opening: Opening) -> Answer:
    try:
        with preserved():
            return opening.function(*opening.arguments)
    except InputError as error:
        # Another policy of this process may have taken the memory.
        if isinstance(error, MemoryError) and not opening.alone:
            raise
        return error
    except MemoryError:
        raise
    # It is somebody's file: whatever it brings about, only that file is set aside.
    except Exception as error:
        return _cannot_be_opened(opening.source, error, opening.expected)


def _record(wanted: Wanted, policies: Sequence[Policy | Absent], watch: Watch) -> Answer:
    if not is_racing(wanted.match.world):
        from nathlon.arena.filming import film_episodes  # most processes film nothing

        return film_episodes(wanted, policies, watch)
    recorded = record_races(wanted.match, policies, wanted.races, wanted.names, watch, wanted.seen_by)
    if wanted.results is not None and not came_out_alike(recorded.results, wanted.results):
        return wanted.came_otherwise
    if wanted.folder is None:
        return recorded
    watch.rest()
    try:
        for race_log in recorded.logs:
            write_recording(wanted.folder / recording_name(wanted.match.key, race_log.race), race_log)
    except OSError as error:
        return InputError(f"{wanted.folder}: the recording cannot be written: {error.strerror}")
    return recorded._replace(logs=[])


def _present(job: MatchJob, number: int, entrant: int, watch: Watch) -> Any | Absent:
    """A policy of a match, watched while it is loaded."""
    if entrant in job.absent:
        return Absent(job.absent[entrant])
    source = job.match.sources[entrant]
    _begin(source, number, entrant, watch)
    try:
        with preserved():
            return match_policy(job.match, entrant)
    except (InputError, MemoryError):
        raise
    except Exception as error:
        if source.partition(":")[0] == DRIVER:  # which is ours
            raise
        raise _cannot_be_opened(source, error, "a policy") from error


def _cannot_be_opened(source: str, error: Exception, expected: str) -> InputError:
    log.error("%s", source, exc_info=error)
    return InputError(f"{source}: cannot be opened ({type(error).__name__}), expected {expected}")


def _begin(source: str, number: int, entrant: int, watch: Watch) -> None:
    """Tell the watch that a policy is to be loaded: our own driver may compile and practise."""
    if source.partition(":")[0] == DRIVER:
        watch.work()
    else:
        watch.ask(number, entrant, first=True)

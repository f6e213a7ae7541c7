"""Verifying a packed run: contents, signature, points, and a sample of its matches raced again."""

from __future__ import annotations

import json
from collections.abc import Collection, Container, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from pydantic import TypeAdapter

from nathlon.arena.engine import Records
from nathlon.arena.match import Match
from nathlon.arena.results import ENTRANTS, RESULTS
from nathlon.arena.store import Store
from nathlon.arena.store.matches import Finished
from nathlon.arena.world_finding import RACING
from nathlon.lab.pack.contents import (
    ENTRANTS_FILE,
    MANIFEST,
    MATCHES,
    NO_FILES,
    SIGNATURE,
    PackedMatch,
    check_no_code,
    digest,
    read_pack,
)
from nathlon.lab.pack.signature import signer
from nathlon.policies.sources import is_path
from nathlon.policies.sources.identity import is_still
from nathlon.results.summary import Summary, read_summary
from nathlon.selection.publish.output import SUMMARY
from nathlon.selection.publish.recordings import run_again
from nathlon.selection.run import OnMatch
from nathlon.sim.errors import InputError
from nathlon.sim.scratch import scratch_folder
from nathlon.tournament.points import rank

RACED_AGAIN = "verify"
"""Stage of the progress."""
AGREES = 1e-9
"""Points by which sums may differ."""


class Verification(NamedTuple):
    """What became of a pack that was looked into.

    Attributes:
        run: its name.
        signed_by: who has signed it; None where it is not signed.
        matches: of its tournament.
        missing: names of entrants whose checkpoints are not in it, as they were gone when the run was
            decided; their matches are not raced again.
        again: how many matches were raced again and came to the same.
        seed: that has drawn them.
        faults: what disagrees, in sentences.
    """

    run: str
    signed_by: str | None
    matches: int
    missing: tuple[str, ...]
    again: int
    seed: int
    faults: tuple[str, ...]


def verify_pack(
    path: Path,
    sample: int,
    seed: int,
    allowed: Path | None,
    recorder: Records,
    on_match: OnMatch,
    worlds: Collection[str] = (RACING,),
) -> Verification:
    """Look whether a pack is what it claims to be.

    Args:
        path: of the pack.
        sample: matches to race again.
        seed: that draws them.
        allowed: file of allowed signers; None takes any key, and a pack without signature.
        recorder: runs the matches.
        on_match: told about progress.
        worlds: names of simulators that may be loaded: they are code.

    Raises:
        InputError: if it is no pack, a file of it was changed, the signature is wrong or missing, or it is
            of another simulator.
    """
    manifest, files = read_pack(path)
    with scratch_folder() as scratch:
        here = Path(scratch) / "files"  # whatever its files are called
        _unpack(path, files, here)
        signed_by = None
        if SIGNATURE in files:
            signed_by = signer(files[MANIFEST], here / SIGNATURE, allowed)
        elif allowed is not None:
            raise InputError(f"{path}: is not signed, expected a signature of somebody in {allowed}")
        summary = read_summary(here / SUMMARY)
        matches, entrants = _read(path, files, here, {one.digest for one in summary.gone if one.digest})
        _check_worlds(path, matches, worlds)
        results = pl.concat([match.results for match in matches])
        faults = _claims(summary, results, entrants)
        missing = entrants.filter(pl.col("source").is_null())
        there = [match for match in matches if set(missing["entrant"]).isdisjoint(match.results["entrant"])]
        drawn = np.random.default_rng(seed).permutation(len(there))[:sample]
        with Store(Path(scratch) / "again.sqlite") as store:
            _keep(path, store, matches)
            wanted = {there[number].key: (0,) for number in sorted(drawn.tolist())}
            on_match(RACED_AGAIN, 0, len(wanted))
            different: list[str] = []
            for done, (_, answer) in enumerate(
                run_again(store, wanted, entrants.drop_nulls("source"), recorder), 1
            ):
                different += [f"{answer}."] if isinstance(answer, InputError) else []
                on_match(RACED_AGAIN, done, len(wanted))
    again = len(wanted) - len(different)
    names = tuple(missing["name"])
    return Verification(manifest.run, signed_by, len(matches), names, again, seed, (*faults, *different))


def _unpack(path: Path, files: Mapping[str, bytes], here: Path) -> None:
    for name, content in files.items():
        try:
            (here / name).parent.mkdir(parents=True, exist_ok=True)
            (here / name).write_bytes(content)
        except OSError as error:  # a name that is too long, or a folder's
            raise InputError(f"{path}: {name[:100]!a} cannot be unpacked: {error.strerror}") from None


def _keep(path: Path, store: Store, matches: Sequence[Finished]) -> None:
    try:
        store.add_matches(matches)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _read(
    path: Path, files: Mapping[str, bytes], here: Path, gone: Container[str]
) -> tuple[list[Finished], pl.DataFrame]:
    """Matches, and ENTRANTS with the places of their files; null of some of those that were gone."""
    try:
        packed = TypeAdapter(list[PackedMatch]).validate_json(files[MATCHES])
        matches = [_match(one) for one in packed]
        rows = TypeAdapter(list[dict[str, Any]]).validate_json(files[ENTRANTS_FILE])
        entrants = pl.DataFrame(rows, schema=ENTRANTS)
        wrong = [
            one.key for one in packed if digest(json.dumps(one.spec, sort_keys=True).encode()) != one.key
        ]
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, pl.exceptions.PolarsError):
        raise InputError(f"{path}: its matches cannot be read, expected what nathlon pack writes") from None
    if wrong or not matches:
        raise InputError(f"{path}: match {(wrong or ['none'])[0][:10]!a} is not what its key says")
    # The store would keep one of them, while the points would be those of all.
    if len({one.key for one in matches}) < len(matches):
        raise InputError(f"{path}: holds a match twice, expected each once")
    places: list[str | None] = []
    for identity, source in entrants.select("entrant", "source").iter_rows():
        if source is None and identity in gone:
            places.append(None)
            continue
        kind = str(source).partition(":")[0]
        if source not in files if is_path(str(source)) else kind not in NO_FILES:
            raise InputError(f"{path}: {source!a} is not in it, expected the checkpoint of an entrant")
        place = str(here / source) if is_path(source) else source
        check_no_code(place)
        places.append(place)
    return matches, entrants.with_columns(source=pl.Series(places, dtype=pl.String))


def _match(packed: PackedMatch) -> Finished:
    with suppress(InputError):  # of another version of nathlon
        Match.from_spec(packed.spec, {})
    results, stage = pl.DataFrame(packed.results, schema=RESULTS), packed.spec["stage"]
    if not isinstance(stage, str):
        raise TypeError(f"stage is {stage!r}")
    return Finished(packed.key, stage, packed.spec, results, packed.processor)


def _check_worlds(path: Path, matches: Collection[Finished], worlds: Collection[str]) -> None:
    """Raise InputError for a match of a world that may not be loaded."""
    for match in matches:
        if (world := match.spec.get("world")) not in worlds:
            raise InputError(
                f"{path}: was raced in {world!a}, which is code, expected --world with this name"
            )


def _claims(summary: Summary, results: pl.DataFrame, entrants: pl.DataFrame) -> list[str]:
    """What of checkpoints and ranking is not as it is claimed to be."""
    faults = [
        f"{name} is another checkpoint than the one that raced."
        for identity, name, source in entrants.select("entrant", "name", "source").iter_rows()
        if source is not None and is_path(source) and not is_still(source, identity)
    ]
    if results["test"].n_unique() > 1:  # whose weights the pack does not say
        return faults
    try:
        computed = rank(results, np.random.default_rng(1), resamples=2)
    except (ArithmeticError, LookupError, TypeError, ValueError, pl.exceptions.PolarsError):
        return [*faults, "No ranking follows from the races."]
    points = dict(computed.select("entrant", "points_per_race").iter_rows())
    names = dict(entrants.select("entrant", "name").iter_rows())
    left_out = points.keys() - {row.entrant for row in summary.ranking}
    faults += [f"{names.get(one, one)} has raced and is not in the ranking." for one in sorted(left_out)]
    return faults + [
        f"The points of {row.name} do not follow from its races."
        for row in summary.ranking
        if not _same(row.points_per_race, points.get(row.entrant))
    ]


def _same(claimed: float | None, found: float | None) -> bool:
    if claimed is None or found is None:
        return claimed is found
    return abs(claimed - found) < AGREES

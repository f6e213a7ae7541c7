"""Packing a run: report, results, checkpoints and the recordings of the races to look at."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Container, Mapping
from pathlib import Path

from nathlon.arena.results import RESULTS
from nathlon.arena.store import Store
from nathlon.lab.pack.contents import (
    CHECKPOINTS,
    ENTRANTS_FILE,
    MANIFEST,
    MATCHES,
    MOST_MIB,
    NO_FILES,
    SAFE,
    SIGNATURE,
    Manifest,
    check_no_code,
    digest,
)
from nathlon.lab.pack.signature import sign
from nathlon.policies.sources import ROLES, is_path, suffix_of
from nathlon.policies.sources.identity import is_still
from nathlon.results.summary import Summary, read_summary, versions
from nathlon.selection.publish.output import REPORT, SUMMARY
from nathlon.selection.publish.sent import copy_policy
from nathlon.sim.decisive import fingerprint
from nathlon.sim.errors import InputError
from nathlon.sim.names import as_named
from nathlon.sim.scratch import scratch_folder
from nathlon.sim.whole_file import whole_file

EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time of all members: the same run gives the same file."""
SPARE_MIB = 16
"""For the manifest and the table of contents."""


def pack_run(folder: Path, store: Store, out: Path, key: Path | None = None) -> Manifest:
    """Write a run into one file.

    Args:
        folder: of the run, with its report.
        store: that holds it.
        out: the file.
        key: that signs it; None leaves it unsigned.

    Raises:
        InputError: if the store does not hold the run, it has no round robin or report, a checkpoint is gone
            or is another one by now, or there is more than a pack may hold.
    """
    summary = read_summary(folder / SUMMARY)
    run = _run_of(folder, summary, store)
    files = {SUMMARY: folder / SUMMARY}
    files |= {
        f"{REPORT}/{path.relative_to(folder / REPORT).as_posix()}": path for path in _files(folder / REPORT)
    }
    for replay in summary.replays:
        if replay.recording:
            path = (folder / REPORT / replay.recording).resolve()
            if not path.is_relative_to(folder.resolve()):
                raise InputError(f"{folder / SUMMARY}: recording {replay.recording!a} is not in its folder")
            files[f"races/{path.name}"] = path
    with scratch_folder() as scratch:
        here = Path(scratch)
        (here / MATCHES).write_text(json.dumps(_matches(store, run)), "utf-8")
        gone = {one.digest for one in summary.gone}
        (here / ENTRANTS_FILE).write_text(json.dumps(_entrants(store, run, here, gone)), "utf-8")
        files |= {path.relative_to(here).as_posix(): path for path in _files(here)}
        contents = _contents(folder, {name: path for name, path in sorted(files.items()) if path.is_file()})
    manifest = Manifest(
        run=run,
        code=fingerprint(),
        versions=versions(),
        files={name: digest(content) for name, content in contents.items()},
    )
    contents[MANIFEST] = manifest.model_dump_json(indent=1).encode()
    if key is not None:
        contents[SIGNATURE] = sign(contents[MANIFEST], key)
    with whole_file(out) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return manifest


def _run_of(folder: Path, summary: Summary, store: Store) -> str:
    """The run in a store that a folder's summary is of: the one of its name, or else the last."""
    names = [record.name for record in reversed(store.runs())]
    for name in sorted(names, key=lambda name: name != folder.resolve().name):
        told = store.facts(name).get("summary")
        if told is not None and Summary.model_validate(told).ranking == summary.ranking:
            return name
    raise InputError(f"{store.name}: holds no run with the ranking of {folder / SUMMARY}, expected its store")


def _contents(folder: Path, files: Mapping[str, Path]) -> dict[str, bytes]:
    """What files hold, by their names in the pack."""
    for name, path in files.items():
        if not SAFE.fullmatch(name):
            raise InputError(f"{path}: expected a name of letters, digits, _, - and . for a file in a pack")
    size = sum(path.stat().st_size for path in files.values())
    if size > (MOST_MIB - SPARE_MIB) << 20:
        raise InputError(
            f"{folder}: has {size >> 20:,} MiB with its checkpoints, expected at most {MOST_MIB}"
        )
    return {name: path.read_bytes() for name, path in files.items()}


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))


def _matches(store: Store, run: str) -> list[dict[str, object]]:
    results = store.results_of_run(run, "tournament")
    if results.is_empty():
        raise InputError(f"{store.name}: run {run} has no round robin, expected races to pack")
    keys = results["match"].unique(maintain_order=True).to_list()
    ran_on = store.processors(keys)
    return [
        {
            "key": key,
            "spec": store.spec(key),
            "results": store.results_of([key]).select(RESULTS.names()).to_dict(as_series=False),
            "processor": ran_on[key],
        }
        for key in keys
    ]


def _entrants(store: Store, run: str, here: Path, gone: Container[str | None]) -> list[dict[str, object]]:
    """Rows of ENTRANTS of all that raced in the tournament, with copies of their files.

    Who was gone when the run was decided has no source.
    """
    raced = set(store.results_of_run(run, "tournament")["entrant"])
    rows = [row for row in store.table(run, "entrants").to_dicts() if row["entrant"] in raced]
    (here / CHECKPOINTS).mkdir()
    for row in rows:
        source, identity = as_named(row["source"]), row["entrant"]
        if source.partition(":")[0] in NO_FILES:
            continue
        if not is_path(source):
            raise InputError(f"{source}: cannot be packed, expected checkpoints, drivers and plugins alone")
        check_no_code(source)
        ending = ROLES if source.endswith(ROLES) else suffix_of(source)
        row["source"] = f"{CHECKPOINTS}/{identity}{ending}"
        copy = here / row["source"]
        if is_still(source, identity):
            copy_policy(Path(source), copy)
        # After the copy too: a training run may write meanwhile.
        if is_still(str(copy), identity):
            continue
        if identity not in gone:
            raise InputError(
                f"{source}: is gone or has changed since it raced, expected the checkpoint of the run"
            )
        row["source"] = None
        copy.unlink(missing_ok=True)
    return rows

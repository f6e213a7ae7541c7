"""What is sent, as a copy that stays whatever becomes of the file in the meantime."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from nathlon.arena.entrant import Entrant
from nathlon.arena.store import Store
from nathlon.policies.sources import COMPOSITE, ROLES, is_path, suffix_of
from nathlon.policies.sources.composite import CompositeSource
from nathlon.policies.sources.identity import is_still, policy_id
from nathlon.policies.sources.normalisation import companions
from nathlon.policies.sources.roles import RolesSource
from nathlon.policies.sources.strategist import strategist_file
from nathlon.results.summary import Sent, Summary
from nathlon.selection.publish.output import OutputFolder
from nathlon.sim.errors import InputError
from nathlon.sim.names import LONGEST_FILE, as_named, file_stem
from nathlon.sim.whole_file import whole_file, write_whole

SENT = "sent"
"""Folder of the copies, in that of the selection."""


def keep_sent(store: Store, run: str, output: OutputFolder) -> tuple[Sent, ...]:
    """Copy whom a run sends into its folder `sent`, unless they are there, and say where.

    What is no file, as a plugin, is only named.

    Raises:
        InputError: if a file is gone or is another one by now, or the copy cannot be written.
    """
    summary: Any = store.facts(run).get("summary")
    sources = dict(store.table(run, "entrants").select("entrant", "source").iter_rows())
    sent = Summary.model_validate(summary).sent if summary else ()
    with output.filling():
        return tuple(_kept(one, as_named(sources[one.entrant]), output.root) for one in sent)


def kept_copies(nights: Path, entrant: Entrant) -> list[str]:
    """Copies of an entrant that nights have sent."""
    pattern = f"*/{SENT}/{_file_name(entrant.name, entrant.id, entrant.source)}"
    return [str(path) for path in sorted(nights.glob(pattern)) if is_still(str(path), entrant.id)]


def _kept(sent: Sent, source: str, root: Path) -> Sent:
    if not is_path(source):
        return sent
    copy = root / SENT / _file_name(sent.name, sent.entrant, source)
    if not is_still(str(copy), sent.entrant):
        if is_still(source, sent.entrant):
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy_policy(Path(source), copy)
        # After the copy too: a training run may go on writing meanwhile.
        if not is_still(str(copy), sent.entrant):
            copy.unlink(missing_ok=True)
            raise InputError(
                f"{source}: is gone or has changed since it was entered, expected the file that is to be sent"
            )
    digest = hashlib.sha256(copy.read_bytes()).hexdigest()
    return sent.model_copy(update={"path": copy.relative_to(root).as_posix(), "digest": digest})


def _file_name(name: str, identity: str, source: str) -> str:
    """Names differ at their ends: one that is cut has the beginning of its id there."""
    ending = ROLES if source.endswith(ROLES) else suffix_of(source)
    stem = file_stem(name)
    return f"{stem}-{identity[:6]}{ending}" if len(stem) == LONGEST_FILE else f"{stem}{ending}"


def copy_policy(source: Path, copy: Path) -> None:
    """Copy a file, and the files that belong to it: those that it names, or that lie beside it."""
    if source.name.endswith(ROLES):
        named = RolesSource.read(source).sources
        _write(copy, {"roles": {role: _named(part, copy.parent) for role, part in named.items()}})
    elif source.name.endswith(COMPOSITE):
        composite = CompositeSource.read(source)
        facts = composite.file.model_dump(mode="json", exclude_none=True)
        for part, copied in zip(composite.file.part, facts["part"], strict=True):
            copied["policy"] = _named(composite.source(part), copy.parent)
        if composite.file.strategist:
            facts["strategist"] = _named_code(composite.file.strategist, source.parent, copy.parent)
        _write(copy, facts)
    else:
        beside = companions(source).named_after(copy)
        for one, other in {copy: source, **beside}.items():
            with whole_file(one) as partial:
                shutil.copyfile(other, partial)


def _named(source: str, folder: Path) -> str:
    """How a copy names one of its policies, which lies beside it, called after its contents."""
    if not is_path(source):
        return source
    copy = folder / f"{policy_id(source)[:12]}{suffix_of(source)}"
    copy_policy(Path(source), copy)
    return copy.name


def _named_code(name: str, folder: Path, copies: Path) -> str:
    """How a copy names its strategist, whose file lies beside it, called after its contents."""
    content = strategist_file(name, folder).read_bytes()
    copy = copies / f"{hashlib.sha256(content).hexdigest()[:12]}.py"
    write_whole(copy, content)
    return f"{copy.name}:{name.rpartition(':')[2]}"


def _write(path: Path, facts: Mapping[str, Any]) -> None:
    """Write facts as TOML."""
    write_whole(path, "\n".join(_toml(facts)).lstrip() + "\n")


def _toml(facts: Mapping[str, Any], place: str = "") -> list[str]:
    """Lines of a table: its tables, and lists of them, after all else."""
    lines = [_line(name, value) for name, value in facts.items() if not _tables(value)]
    for name, value in facts.items():
        head = f"[{place}{name}]" if isinstance(value, dict) else f"[[{place}{name}]]"
        for table in _tables(value):
            lines += ["", head, *_toml(table, f"{place}{name}.")]
    return lines


def _tables(value: Any) -> list[dict[str, Any]]:
    """A value's tables: one, several, or none where it is no table."""
    if isinstance(value, dict):
        return [value]
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []


def _line(name: str, value: Any) -> str:
    """In TOML texts, numbers and lists of them are written as in JSON."""
    return f"{json.dumps(name, ensure_ascii=False)} = {json.dumps(value, ensure_ascii=False)}"

"""What lies beside a policy and decides what it sees: statistics of its observations, and settings of RL Zoo.

Weights do not show that a network was trained on other numbers than its environment gives: `VecNormalize` of
Stable-Baselines3 keeps their means and variances in a pickle. Such files are told by their names and by the
names in them; here nothing is unpickled.
"""

from __future__ import annotations

import hashlib
import os
import pickletools
import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from nathlon.policies.policy_file import content_id, read_policy_file
from nathlon.policies.sources import SUFFIXES, stem_of, suffix_of
from nathlon.policies.sources.sb3_file import was_normalised
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable

HEAD, LONG_HEAD = 1 << 16, 1 << 22
"""Bytes in which a pickle says what it is, and in which it comes to its attributes: spaces stand before."""

WEIGHTS = (".data", "_data")
"""What is added to a graph's name for that of the file beside it that has its weights, as exporters do."""
PICKLES = (".pkl", ".pickle")
OTHERS = (".npz", ".npy", ".json", ".joblib", ".pt", ".pth", ".gz")
"""Suffixes of files that may hold statistics."""

_NAMED = re.compile(
    r"vec[-_. ]?norm(ali[sz]ed?|ali[sz]er|ali[sz]ation)?|normali[sz](e|ed|er|ation)|norm[-_. ]?(stats|params)"
    r"|obs[-_. ]?(rms|norm|stats|normali[sz]er)|running[-_. ]?mean([-_. ]?std)?"
)
_MEANT = (b"VecNormalize", b"RunningMeanStd")
"""Classes of which a pickle of statistics is made."""
_SAYS_NOTHING = {"model", "policy", "checkpoint", "agent", "env", "stats", "statistics", "vec", "norm"}
"""Words in names that do not tell which run a file belongs to."""
_OF_A_RUN = {"best", "checkpoints", "checkpoint", "ckpt", "ckpts", "models", "weights", "saves", "snapshots"}
"""Names of folders below that of their run."""
_ZOO = ("config.yml", "args.yml")
"""Files of a run that RL Zoo keeps beside its statistics: settings and arguments."""
_PUT = ("MEMOIZE", "BINPUT", "LONG_BINPUT", "PUT")

Words = tuple[str, ...]


class Companions(NamedTuple):
    """Files beside a policy that say how its observations were made; None where there is none.

    Attributes:
        statistics: by which they were normalised.
        settings: of a run of RL Zoo.
        weights: of a graph, where they are not inside it.
        arguments: with which such a run was started.
    """

    statistics: Path | None = None
    settings: Path | None = None
    weights: Path | None = None
    arguments: Path | None = None

    def read(self) -> tuple[bytes, ...]:
        """Their contents, empty of what is not there; those of the arguments come last, if they are.

        Raises:
            InputError: if one cannot be read.
        """
        there = self if self.arguments else self[:-1]
        return tuple(read_policy_file(path) if path else b"" for path in there)

    def named_after(self, copy: Path) -> dict[Path, Path]:
        """Where they lie beside a copy of the policy, so that they belong to it: paths there, and here."""
        statistics = copy.with_name(f"{_with_statistics(stem_of(copy))}.pkl")
        settings, arguments = (copy.with_name(f"{stem_of(copy)}.{name}") for name in _ZOO)
        there = statistics, settings, copy.with_name(copy.name + WEIGHTS[0]), arguments
        return {one: path for one, path in zip(there, self, strict=True) if path}


def identity_with(content: bytes, beside: Iterable[bytes]) -> str:
    """SHA-256 of a policy's file, in hexadecimal; of all contents together where something lies beside it."""
    ids = [content_id(one) for one in (content, *beside)]
    if set(ids[1:]) <= {content_id(b"")}:
        return ids[0]
    return hashlib.sha256("\n".join(["with what lies beside it", *ids]).encode()).hexdigest()


def companions(path: Path) -> Companions:
    """What lies beside a policy's file and belongs to it; nothing, unless that is a `.zip` or an `.onnx`.

    Raises:
        InputError: if that cannot be told for sure, or cannot be read here.
    """
    if suffix_of(path) == ".onnx":
        named = [path.with_name(path.name + ending) for ending in WEIGHTS]
        return Companions(weights=next((one for one in named if one.is_file()), None))
    if suffix_of(path) != ".zip":
        return Companions()
    zoo = _zoo(path)
    settings, arguments = (_of_zoo(path, zoo, name) for name in _ZOO)
    return Companions(_own_statistics(path, zoo), settings, arguments=arguments)


def check_as_it_is(path: Path) -> None:
    """See whether a policy is shown what it was trained on.

    Statistics beside a graph may be inside it as well. Those of `VecNormalize(norm_obs=False)` normalise
    rewards alone, which changes nothing.

    Args:
        path: of a policy's file that can be opened.

    Raises:
        InputError: if the statistics of a graph normalise observations, or those of a `.zip` are not found
            though there were some; it names them.
    """
    if suffix_of(path) == ".onnx":
        for statistics in statistics_of(path):
            if _of_observations(statistics, _changed(statistics)):
                named = printable(os.path.relpath(statistics, path.parent))
                raise InputError(
                    f"{path}: {named!r} says that observations were normalised in training, which is not "
                    "done for graphs; expected one with the statistics inside, in a folder without them"
                )
    if suffix_of(path) == ".zip" and companions(path).statistics is None and was_normalised(path):
        named = f"{printable(stem_of(path))}_vecnormalize.pkl"
        raise InputError(
            f"{path}: was trained with VecNormalize, and without its statistics nobody knows whether "
            f"observations were normalised; expected what VecNormalize.save writes, as {named!r} beside it"
        )


def _own_statistics(path: Path, zoo: Path | None) -> Path | None:
    """The statistics of a policy, of which there can be one file."""
    found = statistics_of(path)
    if not found:
        return None
    named = ", ".join(repr(printable(os.path.relpath(one, path.parent))) for one in found)
    wanted = printable(f"{_with_statistics(stem_of(path))}.pkl")
    if strange := [one for one in found if one.suffix.lower() not in PICKLES]:
        raise InputError(
            f"{path}: {printable(os.path.relpath(strange[0], path.parent))!r} seems to say how observations "
            f"were normalised, expected what VecNormalize.save writes, as {wanted!r}, or a folder without it"
        )
    if len(found) > 1:
        raise InputError(f"{path}: its statistics are {named}, expected one file, as {wanted!r}")
    [one] = found
    own = _words(stem_of(path))
    if one.parent == zoo or one.stem == _with_statistics(stem_of(path)) or (_words(one.stem) == own and own):
        return one
    if _is_step(_words(one.stem)):
        raise InputError(
            f"{path}: {named} are the statistics of another step, expected those of its own, {wanted!r}, as "
            "CheckpointCallback(save_vecnormalize=True) writes them"
        )
    # Whose own statistics are there does not need those of all.
    others = [
        other for other in _policies(path.parent) - {own} if other not in map(_words, _stems(path.parent))
    ]
    if others:
        raise InputError(
            f"{path}: {named} may be the statistics of several policies here, but differ from step to step, "
            f"expected its own, as {wanted!r}, or a folder of its own"
        )
    return one


def _with_statistics(stem: str) -> str:
    """What the statistics of a policy are called, as `CheckpointCallback` does."""
    step = re.fullmatch(r"(.*)_(\d+_steps)", stem)
    return f"{step[1]}_vecnormalize_{step[2]}" if step else f"{stem}_vecnormalize"


def _stems(folder: Path) -> list[str]:
    return [one.stem for one in _in(folder)]


def _of_zoo(path: Path, zoo: Path | None, name: str) -> Path | None:
    own = path.with_name(f"{stem_of(path)}.{name}")
    if own.is_file():
        return own
    return zoo / name if zoo and (zoo / name).is_file() else None


def _zoo(path: Path) -> Path | None:
    """The folder in which RL Zoo keeps statistics and settings of a policy's run."""
    folder = path.parent
    below = _kept_below(folder, _changed(folder))
    run = re.sub(r"_\d+$", "", folder.absolute().name)
    for name in (stem_of(path), run):
        if called := [child for child in below if child.name == name]:
            return called[0]
    return below[0] if len(below) == 1 else None


def statistics_of(path: Path) -> list[Path]:
    """The files of statistics that belong to a policy's file: its own, else those of its run."""
    exact = path.with_name(f"{_with_statistics(stem_of(path))}.pkl")
    if exact.is_file():
        return [exact]
    own, folder = _words(stem_of(path)), path.parent
    here = _in(folder)
    policies = _policies(folder)
    named = [(_words(one.stem), one) for one in here]
    mine = [one for words, one in named if words and words == own]
    if mine:
        return mine
    of_run = [one for words, one in named if _is_step(words) and _is_step(own) and words[:-2] == own[:-2]]
    named_after = _names_of_statistics(folder, _changed(folder))
    shared = [
        one for words, one in named if (words not in policies or not words) and one.stem not in named_after
    ]
    if of_run or shared:
        return of_run or shared
    zoo = _zoo(path)
    below = _kept_below(folder, _changed(folder)) if zoo is None else (zoo,)
    return [*(one for child in below for one in filter(_is_shared, _in(child))), *_above(folder)]


@lru_cache
def _kept_below(folder: Path, _: int) -> tuple[Path, ...]:
    """Folders in which RL Zoo keeps statistics below the policies, with the settings of the run."""
    below = [Path(one) for one in _listed(folder)[0]]
    return tuple(child for child in below if any((child / name).is_file() for name in _ZOO))


def _above(folder: Path) -> list[Path]:
    """Those of the run whose checkpoints lie in a folder of their own."""
    above = folder.absolute().parent
    is_of_run = folder.absolute().name.lower() in _OF_A_RUN or not _policies(above)
    return [one for one in _in(above) if _is_shared(one)] if is_of_run else []


def _is_shared(statistics: Path) -> bool:
    return not _words(statistics.stem)


def _in(folder: Path) -> tuple[Path, ...]:
    """The files of statistics in a folder."""
    return _statistics(folder, _changed(folder))


def _policies(folder: Path) -> set[Words]:
    """What the names of a folder's policies tell."""
    return _named_policies(folder, _changed(folder))


@lru_cache
def _statistics(folder: Path, _: int) -> tuple[Path, ...]:
    return tuple(path for path in map(Path, _listed(folder)[1]) if _is_statistics(path))


@lru_cache
def _named_policies(folder: Path, _: int) -> set[Words]:
    return {_words(stem_of(path)) for path in map(Path, _listed(folder)[1]) if suffix_of(path) in SUFFIXES}


@lru_cache
def _names_of_statistics(folder: Path, _: int) -> set[str]:
    """What statistics of a folder's policies are called."""
    return {
        _with_statistics(stem_of(path))
        for path in map(Path, _listed(folder)[1])
        if suffix_of(path) in SUFFIXES
    }


def _changed(path: Path) -> int:
    """When a file or folder has last changed, ns; 0 where that is not known."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _listed(folder: Path) -> tuple[list[str], list[str]]:
    """Paths of the folders and of the regular files in a folder, in order; of one that is closed none."""
    try:
        with os.scandir(folder) as entries:
            found = sorted(entries, key=lambda entry: entry.name)
    except OSError:
        return [], []
    return [one.path for one in found if one.is_dir()], [one.path for one in found if one.is_file()]


def _is_statistics(path: Path) -> bool:
    suffix = path.suffix.lower()
    if suffix in PICKLES:
        return bool(_NAMED.search(path.stem.lower())) or any(name in _head(path, HEAD) for name in _MEANT)
    return suffix in OTHERS and bool(_NAMED.search(path.stem.lower()))


def _words(name: str) -> Words:
    """What tells which policy a name belongs to: `ppo_04096_steps` and `PPO-4096-steps` are the same."""
    rest = _NAMED.sub(" ", name.lower())
    found = [word.lstrip("0") or "0" for word in re.split(r"[-_.\s]+", rest) if word]
    return tuple(word for word in found if word not in _SAYS_NOTHING)


def _is_step(words: Words) -> bool:
    """Whether a name is one of those that `CheckpointCallback` gives: `PREFIX_4096_steps`."""
    return len(words) > 1 and words[-1] == "steps" and words[-2].isdigit()


@lru_cache(maxsize=1000)
def _of_observations(statistics: Path, _: int) -> bool:
    """Whether statistics normalise observations, as `norm_obs` of a pickled `VecNormalize` tells."""
    if statistics.suffix.lower() not in PICKLES:
        return True
    return _flag(_opcodes(_head(statistics, LONG_HEAD)), "norm_obs") is not False


def _flag(opcodes: Iterable[tuple[str, object]], name: str) -> bool | None:
    """The truth value that an attribute of this name has in a pickle; None where it does not say."""
    named = False
    for opcode, argument in opcodes:
        if named and opcode not in _PUT:
            return {"NEWTRUE": True, "NEWFALSE": False}.get(opcode)
        named = named or argument == name
    return None


def _opcodes(head: bytes) -> Iterable[tuple[str, object]]:
    """Names and arguments of a pickle's opcodes, as far as it is whole."""
    try:
        for opcode, argument, _ in pickletools.genops(head):
            yield opcode.name, argument
    except (ValueError, IndexError, EOFError, OverflowError):
        return


def _head(path: Path, size: int) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(size)
    except OSError:
        return b""

"""Statistics by which observations were normalised in training, in a file beside the policy.

Weights do not show that a network was trained on other numbers than its environment gives: `VecNormalize` of
Stable-Baselines3 keeps their means and variances in a pickle. Such files are told by their names and by the
names in them; nothing is unpickled.
"""

from __future__ import annotations

import os
import pickletools
import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from nathlon.policies.sources import SUFFIXES
from nathlon.policies.sources.sb3_file import was_normalised
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable

HEAD, LONG_HEAD = 1 << 16, 1 << 22
"""Bytes in which a pickle says what it is, and in which it comes to its attributes: spaces stand before."""

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
_ZOO = ("args.yml", "config.yml")
"""Files of a run that RL Zoo keeps beside its statistics."""
_PUT = ("MEMOIZE", "BINPUT", "LONG_BINPUT", "PUT")

Words = tuple[str, ...]


def check_as_it_is(path: Path) -> None:
    """See whether a policy may be shown observations as they are.

    Statistics belong to the policies that their name tells, else to all of their folder. Those of
    `VecNormalize(norm_obs=False)` normalise rewards alone, which changes nothing.

    Args:
        path: of a policy's file that can be opened.

    Raises:
        InputError: if the file's statistics normalise observations, or are not found though there were some;
            it names them.
    """
    if path.suffix.lower() not in (".zip", ".onnx"):  # ours say what they take
        return
    found = statistics_of(path)
    for statistics in found:
        if _of_observations(statistics, _changed(statistics)):
            named = printable(os.path.relpath(statistics, path.parent))
            raise InputError(
                f"{path}: {named!r} says that observations were normalised in training, which is not done "
                "here yet; export it to ONNX with the statistics inside, or, if they are another's, move it "
                "to a folder without them, expected a policy that takes observations as they are"
            )
    if path.suffix.lower() == ".zip" and not found and was_normalised(path):
        named = f"{printable(path.stem)}_vecnormalize.pkl"
        raise InputError(
            f"{path}: was trained with VecNormalize, and without its statistics nobody knows whether "
            f"observations were normalised; expected what VecNormalize.save writes, as {named!r} beside it"
        )


def statistics_of(path: Path) -> list[Path]:
    """The files of statistics that belong to a policy's file: its own, else those of its run."""
    own, folder = _words(path.stem), path.parent
    here = _in(folder)
    policies = _policies(folder)
    named = [(_words(one.stem), one) for one in here]
    mine = [one for words, one in named if words and words == own]
    if mine:
        return mine
    of_run = [one for words, one in named if _is_step(words) and _is_step(own) and words[:-2] == own[:-2]]
    shared = [one for words, one in named if words not in policies or not words]
    if of_run or shared:
        return of_run or shared
    below = [one for child in _kept_below(folder, _changed(folder)) for one in _in(child)]
    return [*filter(_is_shared, below), *_above(folder)]


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
    return {_words(path.stem) for path in map(Path, _listed(folder)[1]) if path.suffix.lower() in SUFFIXES}


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

"""Which checkpoints belong to which training run, and which runs to one recipe."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from nathlon.arena.entrance import enter_all
from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.policies.sources.finding import checkpoints_below
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable


@dataclass(frozen=True)
class RecipeRun:
    """A training run of a recipe.

    Attributes:
        recipe: its name.
        run: its name within the recipe, its seed where that is known.
        checkpoints: by their steps.
    """

    recipe: str
    run: str
    checkpoints: tuple[Entrant, ...]

    @property
    def last(self) -> Entrant:
        """The checkpoint that it ended with."""
        return self.checkpoints[-1]


def recipe_folders(given: Iterable[str]) -> dict[str, Path]:
    """Folders of recipes by name, from `FOLDER`, which lends its name, or `NAME=FOLDER`.

    Raises:
        InputError: if a folder is missing, or two recipes have one name.
    """
    found: dict[str, Path] = {}
    for text in given:
        name, _, place = text.rpartition("=")
        if not place:
            raise InputError(f"{text!r}: names no folder, expected FOLDER or NAME=FOLDER")
        folder = Path(place)
        if not folder.is_dir():
            raise InputError(f"{folder}: no such folder, expected one with the training runs of a recipe")
        name = name or folder.resolve().name
        if name in found:
            raise InputError(f"{folder}: there is a recipe {name!r} already, expected NAME=FOLDER")
        found[name] = folder
    return found


def checkpoints_of(folders: Mapping[str, Path], endings: Iterable[str]) -> dict[str, list[Path]]:
    """The checkpoints in folders of recipes; files with the endings are some, see `checkpoints_below`.

    Raises:
        InputError: if a folder holds none.
    """
    files = {name: checkpoints_below(folder, endings) for name, folder in folders.items()}
    for name, paths in files.items():
        if not paths:
            raise InputError(f"{folders[name]}: holds no checkpoint, expected the training runs of a recipe")
    return files


def attempts(
    pool: Pool,
    folders: Mapping[str, Path],
    files: Mapping[str, Sequence[Path]],
    circuit: str,
    car: str,
    world: str,
) -> list[RecipeRun]:
    """The training runs in folders of recipes, with these files.

    Checkpoints in one folder that state one seed are of one run; those that state none are told apart by
    their folders alone.

    Raises:
        InputError: if a checkpoint cannot drive there, or a recipe has no run of its own.
    """
    sources = [str(path) for paths in files.values() for path in paths]
    entered = {
        source: entrant
        for entrant in enter_all(pool, sources, circuit, car, world)
        for source in (entrant.source, *entrant.also)
    }
    own = {name: _runs(folders[name], paths, entered) for name, paths in files.items()}
    for name, runs in own.items():
        if not runs:
            raise InputError(
                f"{folders[name]}: all training runs end with a copy of another recipe's checkpoint, "
                "expected one of its own"
            )
    return [
        RecipeRun(name, run, tuple(checkpoints)) for name, runs in own.items() for run, checkpoints in runs
    ]


def same_files(
    runs: Sequence[RecipeRun], files: Mapping[str, Sequence[Path]], references: Iterable[Entrant]
) -> list[str]:
    """What of some training runs does not count for being the same as something else, in sentences.

    Args:
        runs: that count.
        files: of all recipes.
        references: whom they race.
    """
    raced = {one.id: one for attempt in runs for one in attempt.checkpoints}
    reference = {one.id: one.name for one in references}
    told, known = [], {one.source for one in raced.values()}
    for one in raced.values():
        if one.also:
            known.update(one.also)
            told.append(f"Same file as {one.name}, counted once: {', '.join(map(printable, one.also))}.")
        if one.id in reference:
            told.append(f"{one.name} is the reference {reference[one.id]} itself, which it does not race.")
    left = [str(path) for paths in files.values() for path in paths if str(path) not in known]
    if left:
        told.append(
            f"Left out, as their training run ends with such a copy: {', '.join(map(printable, left))}."
        )
    return told


def _runs(root: Path, paths: Sequence[Path], entered: dict[str, Entrant]) -> list[tuple[str, list[Entrant]]]:
    """Runs of a recipe by name; a seed names its run unless several runs have it.

    One that ends with a copy of another run's checkpoint is no other run, and left out.
    """
    runs: dict[tuple[Path, int | None], list[Entrant]] = {}
    for path in paths:
        entrant = entered[str(path)]
        runs.setdefault((path.parent, entrant.seed), []).append(entrant)
    seeds = [seed for _, seed in runs]
    named = []
    for (folder, seed), found in runs.items():
        checkpoints = sorted(dict.fromkeys(found), key=lambda entrant: (entrant.step or 0, entrant.source))
        if Path(checkpoints[-1].source).parent != folder:
            continue
        place = str(folder.relative_to(root))
        name = f"seed {seed}" if seed is not None and seeds.count(seed) == 1 else place
        named.append((name, [one for one in checkpoints if Path(one.source).parent == folder]))
    return named

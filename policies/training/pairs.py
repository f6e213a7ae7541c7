"""Pairs of circuit and car: which there are, and which is driven next.

Those that go badly, against the built-in driver, are drawn more often.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.bundled import champion
from nathlon.policies.driver import Driver
from nathlon.policies.sources import DRIVER
from nathlon.policies.training.config import TrainingConfig, Variety
from nathlon.policies.training.processes import start_processes
from nathlon.sim.car import load_car
from nathlon.sim.car_family import PARENTS, generate_car, write_car
from nathlon.sim.errors import InputError
from nathlon.sim.physics.course import SurfaceGrip
from nathlon.sim.scenario import Scenario
from nathlon.sim.track import load_track
from nathlon.sim.track.generating import write_generated
from nathlon.sim.track.styles import STYLES
from nathlon.sim.tuning import loosen
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.whole_file import write_whole

CHAMPION = "champion"
"""Of the pair, as it comes with nathlon."""
PAIRS = "pairs"
"""Folder of a run in which the files of its circuits and cars are."""
HOME = ("lindenring", "porto-sereno", "grandes-landes")
SLIPPERY = (0.6, 0.95)
"""Grip of a wet road, as a multiple of that of a dry one."""
LOOSE, LATER, FLATTER = (0.22, 0.8), (1.0, 3.5), (1.1, 1.5)
"""The same of loose ground; by what its tyres peak at a larger slip; shape of their curve."""
EASY, HARD = 0.05, 1.0
"""Least and greatest weight of a pair in the draw."""
WELL = 1.05
"""Share of the driver's speed at which a pair is as easy as can be."""
FORGETTING = 0.5
"""Share of what is known of a pair that a further stint replaces."""


class Pair(NamedTuple):
    """A circuit and a car.

    Attributes:
        circuit, car: names or paths.
        grip: of all surfaces, as a multiple of that when dry.
        lap_s: of the built-in driver; nan where nobody asks.
    """

    circuit: str
    car: str
    grip: float = 1.0
    lap_s: float = float("nan")

    def conditions(self, scenario: Scenario) -> Scenario:
        """The scenario on this grip; on its own where the pair's is that of a dry road."""
        if self.grip == 1.0:
            return scenario
        grip = SurfaceGrip(tarmac=self.grip, kerb=self.grip, grass=self.grip, gravel=self.grip)
        return scenario.model_copy(update={"grip": grip})

    @property
    def has_champion(self) -> bool:
        """Whether a champion comes with nathlon for this circuit and car."""
        try:
            champion(self.circuit, self.car)
        except InputError:
            return False
        return self.grip == 1.0

    def wise(self, policy: str) -> str:
        """A policy's name, of built-in drivers that of one who has practised on this grip.

        Raises:
            InputError: if it is CHAMPION, and none comes with nathlon for this circuit and car.
        """
        if policy == CHAMPION:
            return str(champion(self.circuit, self.car))
        kind, _, settings = policy.partition(":")
        if kind != DRIVER or self.grip == 1.0:
            return policy
        return f"{DRIVER}:{','.join(filter(None, (settings, f'grip={self.grip:g}')))}"


class PairDraw:
    """Draws pairs, more often those that went badly when they were last driven alone.

    Attributes:
        weights: (pairs,) how often each is drawn, relative to the others.
    """

    def __init__(self, pairs: Sequence[Pair], weights: NDArray[np.float64] | None = None) -> None:
        """Some pairs, of which nothing is known yet without weights.

        Raises:
            InputError: if some weights are none, or are of more pairs or of fewer.
        """
        if weights is not None and (
            len(weights) != len(pairs) or (len(pairs) > 1 and not _drawn_by(weights))
        ):
            raise InputError(f"the state weighs pairs by {weights}, expected {len(pairs)} numbers above 0")
        self._pairs = tuple(pairs)
        self.weights = np.full(len(pairs), HARD) if weights is None else weights.copy()

    def draw(self, rng: np.random.Generator) -> Pair:
        """The next pair."""
        if len(self._pairs) == 1:
            return self._pairs[0]
        return self._pairs[rng.choice(len(self._pairs), p=self.weights / self.weights.sum())]

    def note(self, pair: Pair, speed: float) -> None:
        """Learn at what mean speed a pair was driven, m/s of progress on the course."""
        pace = speed * pair.lap_s / load_track(pair.circuit).length
        weight = min(max(WELL - pace, EASY), HARD)
        index = self._pairs.index(pair)
        self.weights[index] += FORGETTING * (weight - self.weights[index])


def _drawn_by(weights: NDArray[np.float64]) -> bool:
    """Whether pairs can be drawn by some weights; an only pair may have any."""
    return bool((np.isfinite(weights) & (weights > 0.0)).all())


def ready_pairs(
    folder: Path, config: TrainingConfig, on_pair: Callable[[int, int], None]
) -> tuple[list[Pair], list[Pair]]:
    """Circuits and cars of a run, to train on, and to evaluate checkpoints on.

    Args:
        folder: of the run.
        config: its configuration.
        on_pair: told how many pairs of a variety are ready, and of how many.

    Raises:
        InputError: as `prepare`.
    """
    if config.variety is not None:
        return prepare(folder / PAIRS, config.variety, on_pair)
    only = [Pair(config.circuit, config.car)]
    return only, only


def prepare(
    folder: Path, variety: Variety, on_pair: Callable[[int, int], None]
) -> tuple[list[Pair], list[Pair]]:
    """The pairs of a variety, to train on and held out; made and practised where they are not yet.

    Args:
        folder: where the files of circuits and cars are; what it holds already is taken.
        variety: which.
        on_pair: told how many pairs are ready, and of how many.

    Raises:
        InputError: if the folder cannot be written or holds something else.
    """
    wanted = [("generated", variety.first_seed + i) for i in range(variety.pairs + variety.held_out)]
    if variety.home:
        wanted += [("home", i) for i in range(len(HOME) * len(PARENTS))]
    notes = [folder / f"{kind}-{number}.json" for kind, number in wanted]
    pairs = {note: _known(note) for note in notes if note.exists()}
    missing = [place for place, note in enumerate(notes) if note not in pairs]
    ready = len(wanted) - len(missing)
    on_pair(ready, len(wanted))
    if missing:
        with start_processes() as processes:
            waiting = [processes.submit(_make, notes[place], *wanted[place], variety) for place in missing]
            try:
                for count, made in enumerate(waiting, ready + 1):
                    made.result()
                    on_pair(count, len(wanted))
            finally:
                processes.shutdown(cancel_futures=True)
        pairs |= {notes[place]: _known(notes[place]) for place in missing}
    held_out = notes[variety.pairs : variety.pairs + variety.held_out]
    return (
        [pair for note in notes if note not in held_out and (pair := pairs[note])],
        [pair for note in held_out if (pair := pairs[note])],
    )


def _known(note: Path) -> Pair | None:
    """The pair of a note; None if no driver gets round."""
    try:
        known = json.loads(read_text(note, "pair"))
        return None if known is None else Pair(*known)
    except (ValueError, TypeError):
        raise InputError(f"{note}: expected the JSON of a circuit, a car, a grip and a lap time") from None


def _make(note: Path, kind: str, number: int, variety: Variety) -> None:
    """Write the note of a pair, with the lap of a driver who has practised."""
    note.parent.mkdir(parents=True, exist_ok=True)
    if kind == "generated":
        pair = _generated(note.parent, number, variety)
    else:
        pair = Pair(HOME[number // len(PARENTS)], PARENTS[number % len(PARENTS)])
    try:
        driver = Driver(pair.circuit, pair.car, grip=pair.grip)
    except InputError:
        made = None
    else:
        made = pair._replace(lap_s=driver.lap_s)
    write_whole(note, json.dumps(made))


def _generated(folder: Path, seed: int, variety: Variety) -> Pair:
    rng = np.random.default_rng(seed)
    style = list(STYLES)[seed % len(STYLES)]
    circuit = folder / f"{style}-{seed}"
    if not circuit.exists():
        write_generated(folder, seed, style)
    slippery = rng.random() < variety.slippery
    loose = slippery and variety.loose > 0.0 and rng.random() < variety.loose
    grip = round(float(rng.uniform(*(LOOSE if loose else SLIPPERY))), 2) if slippery else 1.0
    ground = (float(rng.uniform(*LATER)), float(rng.uniform(*FLATTER))) if loose else None
    shipped = PARENTS[rng.integers(len(PARENTS))] if rng.random() < variety.shipped else None
    if shipped and not ground:
        return Pair(str(circuit), shipped, grip)
    path = folder / f"car-{seed}.toml"
    if not path.exists():
        car = load_car(shipped) if shipped else generate_car(seed)
        write_car(path, loosen(car, *ground) if ground else car)
    return Pair(str(circuit), str(path), grip)

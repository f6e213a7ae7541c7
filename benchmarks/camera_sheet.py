"""A sheet of thirty moments as cameras on cars see them, for docs/observations.md.

Run as `python -m benchmarks.camera_sheet [--out FILE]`. Each picture has 64 x 64 pixels, drawn as wide as the
camera's fields of view say.
"""

from __future__ import annotations

import argparse
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw

from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.car import load_car
from nathlon.sim.conditions import Start
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.track import BANK, CREST, CircuitFile, Grid, Track, X, Y, Z, build_track, load_track
from nathlon.sim.track.crossing import bridge_heights, find_crossings
from nathlon.sim.world import World

OUT = Path(__file__).parent.parent / "docs" / "images" / "camera.png"
COLUMNS, GAP, CAPTION = 5, 6, 16
PIXEL = (5, 2)
"""Width and height of a pixel of a picture on the sheet."""
CARS = {"lindenring": "gt3", "porto-sereno": "coupe", "grandes-landes": "prototype"}
BRIDGE = "a figure of eight"

Place = tuple[float, float, float]
"""Metres ahead of the one who looks, metres to the left of the centre line, and heading, rad."""


class Moment(NamedTuple):
    """A picture to take.

    Attributes:
        title: what is seen.
        circuit: where.
        at: along the lap, m.
        lateral, heading: of the car that looks, m and rad.
        others: where the others are.
        braking: whether they brake.
        mount: of the camera.
    """

    title: str
    circuit: str
    at: float
    lateral: float = 0.0
    heading: float = 0.0
    others: tuple[Place, ...] = ()
    braking: bool = False
    mount: str = "cockpit"


PACK = (
    (9.0, 2.0, 0.0),
    (14.0, -2.5, 0.0),
    (22.0, 1.0, 0.02),
    (27.0, -1.5, 0.0),
    (38.0, 2.5, 0.0),
    (60.0, 0, 0),
)
GRID = tuple((9.0 * place, 3.0 if place % 2 else -3.0, 0.0) for place in range(1, 9))


@cache
def circuit(name: str) -> Track:
    """A shipped circuit, or a figure of eight with a bridge."""
    if name != BRIDGE:
        return load_track(name)
    angle = np.linspace(0.0, 2.0 * np.pi, 600, endpoint=False) + 0.8
    line = np.stack([400.0 * np.sin(angle), 250.0 * np.sin(2.0 * angle)], axis=1)
    height = bridge_heights(find_crossings(line), len(line), 3.0)
    columns = (*line.T, height, 5.0, 5.0, 0.0, 8.0, 8.0)
    facts = CircuitFile(
        name=BRIDGE,
        description="",
        centre_line="",
        runoff="grass",
        sectors_m=(500.0, 1000.0),
        grid=Grid(pole_m=0.0, spacing_m=9.0, lateral_m=2.0),
    )
    return build_track(np.stack([np.broadcast_to(each, len(line)) for each in columns], axis=1), facts)


def place_of(name: str, column: int, sign: float) -> float:
    """Where a column of a circuit's table is largest, or smallest, m."""
    track = circuit(name)
    return float(np.argmax(sign * track.table[:, column]) * track.spacing)


def moments() -> list[Moment]:
    """All of them."""
    crest, dip = place_of("grandes-landes", CREST, -1.0), place_of("lindenring", CREST, 1.0)
    bank = place_of("lindenring", BANK, -1.0)
    eight = circuit(BRIDGE)
    (crossing,) = find_crossings(eight.table[:, [X, Y]])
    rows = sorted((crossing.first, crossing.second), key=lambda row: float(eight.table[row, Z]))
    below, above = (row * eight.spacing for row in rows)
    return [
        Moment("straight", "lindenring", 1700.0),
        Moment("start line, on the grid", "lindenring", -85.0, 3.0, others=GRID),
        Moment("into a bend", "lindenring", 410.0),
        Moment("in a bend", "lindenring", 480.0, 2.0, 0.1),
        Moment("hairpin", "lindenring", 2350.0, -3.0),
        Moment("esses", "lindenring", 2700.0),
        Moment("chicane", "lindenring", 5470.0),
        Moment("chicane in traffic", "lindenring", 5455.0, others=PACK, braking=True),
        Moment("banked bend", "lindenring", bank - 20.0, 3.0),
        Moment("a dip", "lindenring", dip - 40.0),
        Moment("a crest", "grandes-landes", crest - 60.0),
        Moment("a car over the crest", "grandes-landes", crest - 30.0, others=((60.0, 1.0, 0.0),)),
        Moment("onto a bridge", BRIDGE, above - 60.0),
        Moment("towards a bridge", BRIDGE, below - 60.0),
        Moment("a car on the bridge", BRIDGE, below - 45.0, others=((above - below + 45.0, 0.0, 0.0),)),
        Moment("a pack", "lindenring", 1800.0, others=PACK),
        Moment("a pack brakes", "lindenring", 2300.0, others=PACK, braking=True),
        Moment("a car ahead", "lindenring", 1800.0, others=((12.0, 0.0, 0.0),)),
        Moment("it brakes", "lindenring", 1800.0, others=((12.0, 0.0, 0.0),), braking=True),
        Moment("side by side", "lindenring", 1800.0, -1.5, others=((3.2, 1.4, 0.0),)),
        Moment("a car turned round", "lindenring", 1800.0, others=((14.0, 1.0, 2.2),)),
        Moment("in the gravel", "lindenring", 480.0, 11.0, 0.0),
        Moment(
            "facing back", "lindenring", 1800.0, 0.0, np.pi, others=((-20.0, 1.5, 0.0), (-45.0, -2.0, 0.0))
        ),
        Moment("across the road", "lindenring", 1800.0, -2.0, 1.6),
        Moment("between walls", "porto-sereno", 260.0),
        Moment("harbour straight", "porto-sereno", 2000.0, others=PACK),
        Moment("hairpin between walls", "porto-sereno", 1030.0, -2.0),
        Moment("from the roof", "lindenring", 1800.0, others=PACK, mount="roof"),
        Moment("from behind, in a pack", "lindenring", 1800.0, others=PACK, mount="chase"),
        Moment("from behind, in a bend", "lindenring", 480.0, 2.0, 0.1, mount="chase"),
    ]


def shoot(moment: Moment) -> Image.Image:
    """The picture of a moment, as large as it is on the sheet."""
    places = np.array([(0.0, moment.lateral, moment.heading), *moment.others])
    track, still = circuit(moment.circuit), np.zeros(len(places))
    world = World(track, load_car(CARS.get(moment.circuit, "gt3")), 1, len(places))
    start = Start(moment.at + places[:, 0], places[:, 1], places[:, 2], still, np.full(len(places), np.inf))
    world.reset(0, start)
    world.state["brake"][0, 1:] = float(moment.braking)
    spec = ObservationSpec(camera=CameraSpec(mount=moment.mount))
    picture = Image.fromarray(world.observe(spec, np.zeros(1, np.int64), np.zeros(1, np.int64))[0]["picture"])
    return picture.resize((picture.width * PIXEL[0], picture.height * PIXEL[1]), Image.Resampling.NEAREST)


def sheet() -> Image.Image:
    """All moments with their titles."""
    pictures = [(moment, shoot(moment)) for moment in moments()]
    width, height = pictures[0][1].size
    step = width + GAP, height + CAPTION + GAP
    rows = -(-len(pictures) // COLUMNS)
    whole = Image.new("RGB", (COLUMNS * step[0] + GAP, rows * step[1] + GAP), "white")
    draw = ImageDraw.Draw(whole)
    for number, (moment, picture) in enumerate(pictures):
        corner = GAP + number % COLUMNS * step[0], GAP + number // COLUMNS * step[1]
        whole.paste(picture, corner)
        draw.text((corner[0], corner[1] + height + 2), moment.title, fill="black")
    return whole


def main() -> None:
    """Draw the sheet."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=OUT, metavar="FILE")
    chosen = parser.parse_args()
    sheet().save(chosen.out, optimize=True)


if __name__ == "__main__":
    main()

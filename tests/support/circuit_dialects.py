"""One circuit as files of every dialect: a stadium of straights and half circles, driven to the left."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.support.centre_lines import path_of, stadium

STRAIGHT, RADIUS = 300.0, 60.0
LENGTH = 2 * STRAIGHT + 2 * np.pi * RADIUS
AREA = 2 * STRAIGHT * RADIUS + np.pi * RADIUS**2
RIGHT, LEFT, RELIEF = 5.0, 6.0, 6.0
LON, LAT = 11.0, 48.0
DEGREE_M = 6_378_137.0 * np.pi / 180.0


def centre(spacing: float = 5.0) -> NDArray[np.float64]:
    """The centre line, (n, 2), m."""
    return path_of(stadium(STRAIGHT, RADIUS), spacing)


def edge(offset: float) -> NDArray[np.float64]:
    """The line as far to the left, (n, 2), m."""
    line = path_of(stadium(STRAIGHT, RADIUS - offset))
    return line + np.array([0.0, offset])


def heights(points: int) -> NDArray[np.float64]:
    """A hill and a dale over the lap, (n,), m."""
    return RELIEF / 2 * np.sin(2 * np.pi * np.arange(points) / points)


def degrees(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Longitude and latitude by the radii of curvature of the ellipsoid, apart from the code, (n, 2)."""
    e2, sine = 0.00669437999014, np.sin(np.radians(LAT))
    meridian = DEGREE_M * (1 - e2) / (1 - e2 * sine**2) ** 1.5
    parallel = DEGREE_M * np.cos(np.radians(LAT)) / np.sqrt(1 - e2 * sine**2)
    return line / [parallel, meridian] + [LON, LAT]


def _closed(line: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.vstack([line, line[:1]])


def _table(header: str, separator: str, columns: Iterable[NDArray[Any]], *, comma: bool = False) -> bytes:
    rows = [separator.join(f"{cell:.6f}" for cell in row) for row in np.column_stack([*columns])]
    text = "\n".join(row.replace(".", ",") if comma else row for row in rows)
    return f"{header}\n{text}\n".encode() if header else f"{text}\n".encode()


def _sides(line: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.full(len(line), RIGHT), np.full(len(line), LEFT)


def database() -> bytes:
    line = centre()
    return _table("# x_m,y_m,w_tr_right_m,w_tr_left_m", ",", [line, *_sides(line)])


def semicolons() -> bytes:
    line = centre()
    right, left = _sides(line)
    columns = [np.arange(len(line)) * 5.0, line, np.zeros(len(line)), left, right, heights(len(line))]
    header = '"S_M";"X_M";"Y_M";"psi_rad";"W_TR_LEFT_M";"W_TR_RIGHT_M";"Z_M"'
    return b"# made by hand\n" + _table(header, ";", columns).replace(b"\n30.0", b"\n# half way\n\n30.0", 1)


def tabs() -> bytes:
    line = centre()
    return _table(
        "Easting [m]\tNorthing [m]\tWidth [m]",
        "\t",
        [line + np.array([691_000.0, 5_334_000.0]), np.full(len(line), 11.0)],
    )


def decimal_commas() -> bytes:
    line = _closed(centre())
    return _table("x;y;width_right;width_left", ";", [line, *_sides(line)], comma=True)


def utf_16() -> bytes:
    return database().decode().encode("utf-16")


def unnamed() -> bytes:
    line = centre()
    rows = [f"{n} {x:.4f} {y:.4f} {RIGHT} {LEFT}" for n, (x, y) in enumerate(line)]
    return ("\n".join(rows) + "\n").encode("utf-8-sig")


def kilometres() -> bytes:
    return _table("x_km,y_km", ",", [centre() / 1000.0])


def raceline() -> bytes:
    line = centre(1.0)
    zeros = np.zeros((len(line), 2))
    return _table(
        "# 17b4de0d\n# 603fd398\n# s_m; x_m; y_m; psi_rad; kappa_radpm",
        "; ",
        [np.arange(len(line)), line, zeros],
    )


def degree_table() -> bytes:
    return _table("lat,lon,alt", ",", [degrees(centre())[:, ::-1], heights(len(centre()))])


def edge_table() -> bytes:
    line = centre()
    left, right = _resampled(edge(LEFT), len(line)), _resampled(edge(-RIGHT), len(line))
    return _table("left_x,left_y,right_x,right_y", ",", [left, right])


def _resampled(line: NDArray[np.float64], points: int) -> NDArray[np.float64]:
    at = np.linspace(0.0, len(line), points, endpoint=False)
    closed = _closed(line)
    return np.column_stack([np.interp(at, np.arange(len(closed)), closed[:, axis]) for axis in (0, 1)])


def gpx(laps: int = 1) -> bytes:
    places = np.tile(degrees(centre()), (laps, 1))
    rise = np.tile(heights(len(centre())), laps)
    points = "".join(
        f'<trkpt lat="{lat:.8f}" lon="{lon:.8f}"><ele>{z:.2f}</ele></trkpt>'
        for (lon, lat), z in zip(places, rise, strict=True)
    )
    head = '<?xml version="1.0"?><gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1"><trk><name>lap</name>'
    return f"{head}<trkseg>{points}</trkseg></trk></gpx>".encode()


def _coordinates(line: NDArray[np.float64]) -> str:
    return " ".join(f"{lon:.8f},{lat:.8f},0" for lon, lat in degrees(line))


def kml(**edges: NDArray[np.float64]) -> bytes:
    marks = "".join(
        f"<Placemark><name>{name}</name><LineString><coordinates>{_coordinates(_closed(line))}</coordinates>"
        "</LineString></Placemark>"
        for name, line in (edges or {"left": edge(LEFT), "right": edge(-RIGHT)}).items()
    )
    return f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{marks}</Document></kml>'.encode()


def _parts() -> list[NDArray[np.float64]]:
    """Three parts of the line, the second against the driving direction."""
    line = _closed(centre())
    return [line[:60], line[59:100][::-1], line[99:]]


def geojson() -> bytes:
    line = [[round(float(v), 8) for v in point] for point in degrees(_closed(centre()))]
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": line}}
    return json.dumps({"type": "FeatureCollection", "features": [feature]}).encode()


def osm() -> bytes:
    nodes: dict[tuple[str, str], int] = {}
    ways = []
    pit = np.column_stack(
        [np.linspace(20.0, 120.0, 9), [0.0, -9.0, -15.0, -15.0, -15.0, -15.0, -15.0, -9.0, 0.0]]
    )
    for number, (line, tags) in enumerate(
        [*((part, "") for part in _parts()), (pit, '<tag k="name" v="Pit lane"/>')]
    ):
        refs = []
        for lon, lat in degrees(line):
            refs.append(nodes.setdefault((f"{lon:.8f}", f"{lat:.8f}"), len(nodes) + 1))
        nds = "".join(f'<nd ref="{ref}"/>' for ref in refs)
        ways.append(f'<way id="{number}">{nds}<tag k="highway" v="raceway"/>{tags}</way>')
    made = "".join(f'<node id="{ref}" lon="{lon}" lat="{lat}"/>' for (lon, lat), ref in nodes.items())
    return f'<osm version="0.6">{made}{"".join(ways)}</osm>'.encode()


def commonroad() -> bytes:
    def bound(tag: str, line: NDArray[np.float64]) -> str:
        points = "".join(f"<point><x>{x:.4f}</x><y>{y:.4f}</y></point>" for x, y in line)
        return f"<{tag}>{points}</{tag}>"

    left, right = (_closed(_resampled(edge(offset), 200)) for offset in (LEFT, -RIGHT))
    lanelets = "".join(
        f'<lanelet id="{number}">{bound("leftBound", left[start : start + 51])}'
        f'{bound("rightBound", right[start : start + 51])}<successor ref="{(number + 1) % 4}"/></lanelet>'
        for number, start in enumerate(range(0, 200, 50))
    )
    return f'<?xml version="1.0"?><commonRoad commonRoadVersion="2020a">{lanelets}</commonRoad>'.encode()


def torcs() -> bytes:
    def segment(name: str, kind: str, **numbers: tuple[float, str]) -> str:
        inside = "".join(
            f'<attnum name="{key.replace("_", " ")}" unit="{unit}" val="{value}"/>'
            for key, (value, unit) in numbers.items()
        )
        return f'<section name="{name}"><attstr name="type" val="{kind}"/>{inside}</section>'

    bend = {"radius": (RADIUS, "m"), "arc": (180.0, "deg")}
    segments = [
        segment(
            "a",
            "str",
            lg=(STRAIGHT / 2, "m"),
            z_start=(0.0, "m"),
            z_end=(RELIEF / 2, "m"),
            banking_end=(-5.0, "deg"),
        ),
        segment("b", "lft", **bend, z_end=(0.0, "m"), banking_end=(-5.0, "deg")),
        segment(
            "c", "str", lg=(STRAIGHT / 0.3048, "ft"), z_end=(-RELIEF / 2, "m"), banking_end=(-5.0, "deg")
        ),
        segment("d", "lft", **bend, z_end=(0.0, "m"), banking_end=(-5.0, "deg")),
        segment("e", "str", lg=(STRAIGHT / 2, "m"), z_end=(0.0, "m")),
    ]
    head = '<!DOCTYPE params SYSTEM "params.dtd" [<!ENTITY default-surfaces SYSTEM "surfaces.xml">]>'
    return (
        f'<?xml version="1.0"?>{head}<params name="stadium"><section name="Surfaces">'
        '&default-surfaces;</section><section name="Main Track">'
        f'<attnum name="width" unit="m" val="{RIGHT + LEFT}"/>'
        f'<section name="Track Segments">{"".join(segments)}</section></section></params>'
    ).encode()


def arcs() -> bytes:
    bend = f'<corner sweep="{np.pi}" radius="{RADIUS}" direction="left"/>'
    half = f'<straight length="{STRAIGHT / 2}"/>'
    inside = f'{half}{bend}<straight length="{STRAIGHT}"/>{bend}<straight/>'
    return f'<oval type="straight-and-curve" width="11">{inside}</oval>'.encode()


def fastest_lap() -> bytes:
    line = centre()
    count = len(line)

    def array(name: str, values: Sequence[float] | NDArray[np.float64]) -> str:
        return f"<{name}>{', '.join(f'{value:.5f}' for value in values)}</{name}>"

    line_ = array("x", line[:, 0]) + array("y", -line[:, 1]) + array("z", -heights(count))
    data = f"<centerline>{line_}</centerline>{array('nl', [LEFT] * count)}{array('nr', [RIGHT] * count)}"
    return (
        '<circuit format="discrete" type="closed"><GPS_parameters><!-- y = -earth_radius.(latitude) -->'
        f'</GPS_parameters><data number_of_points="{count}">{data}</data></circuit>'
    ).encode()


def fast_lane() -> bytes:
    """The line that cars take, half a metre right of the middle."""
    line = _resampled(edge(-0.5), 250)
    rise = heights(len(line))
    points = b"".join(
        struct.pack("<ffffi", x, z, -y, 4.0 * number, number)
        for number, ((x, y), z) in enumerate(zip(line, rise, strict=True))
    )
    extra = struct.pack("<18f", *[0.0] * 5, LEFT + 0.5, RIGHT - 0.5, *[0.0] * 11) * len(line)
    return struct.pack("<iiii", 7, len(line), 0, 0) + points + struct.pack("<i", len(line)) + extra


DIALECTS: dict[str, tuple[Callable[[], bytes], bool, bool]] = {
    "database": (database, True, False),
    "semicolons": (semicolons, True, True),
    "tabs": (tabs, True, False),
    "decimal commas": (decimal_commas, True, False),
    "utf-16": (utf_16, True, False),
    "unnamed": (unnamed, True, False),
    "kilometres": (kilometres, False, False),
    "raceline": (raceline, False, False),
    "degree table": (degree_table, False, True),
    "edge table": (edge_table, True, False),
    "gpx": (gpx, False, True),
    "kml": (kml, True, False),
    "geojson": (geojson, False, False),
    "osm": (osm, False, False),
    "commonroad": (commonroad, True, False),
    "torcs": (torcs, True, True),
    "arcs": (arcs, True, False),
    "fastest-lap": (fastest_lap, True, True),
    "fast_lane.ai": (fast_lane, True, True),
}
"""How each is made, and whether it knows widths and heights."""

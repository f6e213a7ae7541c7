"""Lines of maps and receivers: GPX, KML, OpenStreetMap and GeoJSON."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from nathlon.sim.errors import InputError
from nathlon.sim.track.formats.joining import Way, outline_of
from nathlon.sim.track.formats.markup import place, text_at
from nathlon.sim.track.formats.outline import LARGEST, CircuitLine, check_most, to_number

PIT = re.compile(r"\bpits?\b|pit[ _-]?(lane|road|stop)|paddock", re.IGNORECASE)
LINES = {"LineString": 1, "MultiLineString": 2, "Polygon": 2, "MultiPolygon": 3}
"""Kinds of geometry, and how deep their points lie in lists."""


def read_gpx(root: Element) -> CircuitLine:
    """Read tracks, or routes where there are none.

    Raises:
        InputError: if there is neither, or a place is no number.
    """

    def points(line: Element, tag: str) -> Iterator[tuple[str, str | None, str | None, str | None]]:
        for point in line.iter(tag):
            yield place(point), point.get("lon"), point.get("lat"), text_at(point, "ele")

    ways = [
        _way(points(line, tag), text_at(parent, "name") or "")
        for outer, inner, tag in (("trk", "trkseg", "trkpt"), ("rte", ".", "rtept"))
        for parent in root.iter(outer)
        for line in parent.iterfind(inner)
    ]
    return outline_of("GPX", ways, "expected a track with points <trkpt lat lon>")


def read_kml(root: Element) -> CircuitLine:
    """Read lines, rings and tracks of placemarks.

    Raises:
        InputError: if there are none, or a place is no number.
    """

    def points(words: Iterable[str], where: str, separator: str | None) -> Iterator[tuple[str, ...]]:
        for number, word in enumerate(words, start=1):
            yield (f"{where}, point {number}", *[*word.split(separator), "", "", ""][:3])

    ways = []
    for mark in root.iter("Placemark"):
        name = text_at(mark, "name") or ""
        for element in mark.iter():
            if element.tag == "coordinates" and len((element.text or "").split()) > 1:
                ways.append(_way(points((element.text or "").split(), place(element), ","), name))
            elif element.tag == "Track":
                words = [coord.text or "" for coord in element.iterfind("coord")]
                ways.append(_way(points(words, place(element), None), name))
    return outline_of("KML", ways, "expected placemarks with lines of <coordinates>")


def read_osm(root: Element) -> CircuitLine:
    """Read the raceways of an extract, or all its ways where none is a raceway.

    Raises:
        InputError: if there are no ways with nodes.
    """
    nodes = {node.get("id", ""): node for node in root.iterfind("node")}
    members = {
        member.get("ref", "")
        for relation in root.iterfind("relation")
        if _tags(relation).get("type") == "circuit"
        for member in relation.iterfind("member")
        if member.get("type") == "way"
    }
    ways = []
    for element in root.iterfind("way"):
        found = [nodes[ref] for ref in (nd.get("ref", "") for nd in element.iterfind("nd")) if ref in nodes]
        points = ((place(node), node.get("lon"), node.get("lat"), _tags(node).get("ele")) for node in found)
        ways.append(_way(points, "", _tags(element), element.get("id") in members))
    return outline_of("OpenStreetMap", ways, "expected ways with their nodes")


def read_geojson(text: str) -> CircuitLine:
    """Read the lines and rings of a GeoJSON text.

    Raises:
        InputError: if it is no JSON, or has no lines.
    """
    expected = "expected GeoJSON with a LineString, a Polygon or several LineStrings that join"
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"not JSON ({str(error)[:80]}), {expected}") from None
    ways = []
    for number, feature in enumerate(_features(value), start=1):
        where = f"feature {number}"
        known = feature.get("properties")
        tags = (
            {key: one for key, one in known.items() if isinstance(one, str)}
            if isinstance(known, dict)
            else {}
        )
        relations = known.get("@relations") if isinstance(known, dict) else None
        member = isinstance(relations, list) and any(_is_circuit(one) for one in relations)
        for geometry in _geometries(feature.get("geometry")):
            deep = LINES.get(str(geometry.get("type")), 0)
            for line in _lists(geometry.get("coordinates"), deep):
                places = (
                    (f"{where}, point {at}", *[*(point if isinstance(point, list) else []), "", "", ""][:3])
                    for at, point in enumerate(line, start=1)
                )
                ways.append(_way(places, "", tags, member))
    return outline_of("GeoJSON", ways, expected)


def _features(value: Any) -> list[dict[str, Any]]:
    if not isinstance(value, dict):
        return []
    if value.get("type") == "FeatureCollection":
        found = value.get("features")
        return [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []
    return [value] if value.get("type") == "Feature" else [{"geometry": value}]


def _geometries(value: Any) -> list[dict[str, Any]]:
    if not isinstance(value, dict):
        return []
    if value.get("type") != "GeometryCollection":
        return [value]
    found = value.get("geometries")
    return [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []


def _lists(value: Any, deep: int) -> list[list[Any]]:
    """Lines of points that lie in lists `deep` deep."""
    if deep == 0 or not isinstance(value, list):
        return []
    return [value] if deep == 1 else [line for one in value for line in _lists(one, deep - 1)]


def _is_circuit(relation: Any) -> bool:
    tags = relation.get("reltags") if isinstance(relation, dict) else None
    return isinstance(tags, dict) and tags.get("type") == "circuit"


def _tags(element: Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in element.iterfind("tag")}


def _way(
    points: Iterable[tuple[Any, ...]], name: str, tags: Mapping[str, str] | None = None, member: bool = False
) -> Way:
    """A way of points (place in the file, longitude, latitude, height or nothing)."""
    tags = tags or {}
    rows, places = [], []
    for where, longitude, latitude, height in points:
        rows.append(
            (
                _coordinate(longitude, where, "longitude"),
                _coordinate(latitude, where, "latitude"),
                _coordinate(height, where, "height") if height not in (None, "") else np.nan,
            )
        )
        places.append(where)
        check_most(len(rows), "the line")
    said = " ".join([name, *(tags.get(key, "") for key in ("name", "description", "service", "raceway"))])
    return Way(
        np.array(rows, np.float64).reshape(-1, 3),
        places,
        name=said.lower(),
        raceway=tags.get("highway") == "raceway",
        member=member,
        beside=bool(PIT.search(said)) or "kart" in tags.get("sport", ""),
    )


def _coordinate(value: Any, where: str, field: str) -> float:
    if isinstance(value, str) or value is None:
        return to_number(value, where, field)
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST:
        return float(value)
    raise InputError(f"{where}: {field} is {str(value)[:40]!r}, expected a number")

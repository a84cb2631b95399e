"""An OpenStreetMap extract (.osm, XML) that somebody has: the buildings, roads and trees in it, in metres.

Format: https://wiki.openstreetmap.org/wiki/OSM_XML. Nothing is fetched.
"""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

Xy = tuple[float, float]
MAX_BYTES = 64 * 1024 * 1024
_EARTH_M = 6_371_008.8
_HEAD_BYTES = 4096


class BadMap(ValueError):
    """A file that is no extract, or has nothing to deliver to; the message says what would be right."""


class LatLon(NamedTuple):
    """Degrees north and east."""

    lat: float
    lon: float


class OsmBuilding(NamedTuple):
    """`id` as in `way/123`; `outline` in metres about the map's middle, as it was drawn; `tags` as they stand."""

    id: str
    outline: tuple[Xy, ...]
    tags: dict[str, str]


class OsmRoad(NamedTuple):
    points: tuple[Xy, ...]
    tags: dict[str, str]


class OsmMap(NamedTuple):
    """`middle` is where (0, 0) lies; `in_pieces`: buildings left out, as their outline is made of several ways."""

    middle: LatLon
    buildings: tuple[OsmBuilding, ...]
    roads: tuple[OsmRoad, ...]
    trees: tuple[Xy, ...]
    in_pieces: int

    def place(self, at: LatLon) -> Xy:
        """Metres east and north of the middle; a plane is good enough over some hundred metres."""
        return _projected(at, self.middle)


class _Way(NamedTuple):
    id: str
    nodes: tuple[str, ...]
    tags: dict[str, str]

    @property
    def closed(self) -> bool:
        return len(self.nodes) > 3 and self.nodes[0] == self.nodes[-1]


class _Raw(NamedTuple):
    nodes: dict[str, LatLon]
    trees: list[LatLon]
    ways: dict[str, _Way]
    multipolygons: list[tuple[str, list[str], dict[str, str]]]


def read_map(path: Path) -> OsmMap:
    """Raises BadMap."""
    if path.name.endswith(".pbf"):
        raise BadMap(f"{path}: a .pbf is not read; make an .osm of it first, for example with `osmium cat`")
    try:
        if path.stat().st_size > MAX_BYTES:
            raise BadMap(f"{path} is larger than {MAX_BYTES // 2**20} MiB: take an extract of some streets")
        with path.open("rb") as file:
            if b"<!DOCTYPE" in file.read(_HEAD_BYTES):
                raise BadMap(f"{path} declares a document type, which no OpenStreetMap extract does")
        raw = _parsed(path)
    except OSError as error:
        raise BadMap(f"{path}: {error.strerror}") from None
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise BadMap(f"{path} is not an OpenStreetMap extract (XML): {error}") from None
    except (KeyError, ValueError) as error:
        if isinstance(error, BadMap):
            raise
        raise BadMap(f"{path}: an element without its id or place, or with one that is no number ({error})") from None
    if not raw.nodes:
        raise BadMap(f"{path} has no nodes: it is no OpenStreetMap extract")
    return _map_of(raw)


def _parsed(path: Path) -> _Raw:
    raw = _Raw({}, [], {}, [])
    for _, element in ElementTree.iterparse(path):
        if element.tag == "node":
            at = LatLon(float(element.attrib["lat"]), float(element.attrib["lon"]))
            raw.nodes[element.attrib["id"]] = at
            if _tags(element).get("natural") == "tree":
                raw.trees.append(at)
        elif element.tag == "way":
            nodes = tuple(child.attrib["ref"] for child in element if child.tag == "nd")
            raw.ways[element.attrib["id"]] = _Way(element.attrib["id"], nodes, _tags(element))
        elif element.tag == "relation":
            tags = _tags(element)
            members = [child for child in element if child.tag == "member" and child.get("role") in ("outer", "")]
            if tags.get("type") == "multipolygon" and "building" in tags:
                raw.multipolygons.append((element.attrib["id"], [m.attrib["ref"] for m in members], tags))
        else:
            continue
        element.clear()
    return raw


def _tags(element: ElementTree.Element) -> dict[str, str]:
    return {child.attrib["k"]: child.attrib["v"] for child in element if child.tag == "tag"}


def _map_of(raw: _Raw) -> OsmMap:
    middle = _middle(raw.nodes.values())

    def places(way: _Way) -> tuple[Xy, ...]:
        # an extract may cut a way off: then its last nodes are not in it
        return tuple(_projected(raw.nodes[node], middle) for node in way.nodes if node in raw.nodes)

    ways = list(raw.ways.values())
    buildings = [
        OsmBuilding(f"way/{way.id}", places(way)[:-1], way.tags)
        for way in ways
        if way.closed and way.tags.get("building", "no") != "no" and len(places(way)) == len(way.nodes)
    ]
    in_pieces = 0
    for number, outers, tags in raw.multipolygons:
        found = [raw.ways[outer] for outer in outers if outer in raw.ways]
        if len(outers) == 1 and found and found[0].closed and len(places(found[0])) == len(found[0].nodes):
            buildings.append(OsmBuilding(f"relation/{number}", places(found[0])[:-1], tags))
        else:
            in_pieces += 1
    roads = [OsmRoad(places(way), way.tags) for way in ways if "highway" in way.tags and len(places(way)) > 1]
    trees = tuple(_projected(tree, middle) for tree in raw.trees)
    return OsmMap(middle, tuple(buildings), tuple(roads), trees, in_pieces)


def _middle(places: Iterable[LatLon]) -> LatLon:
    lats, lons = zip(*places, strict=True)
    return LatLon((min(lats) + max(lats)) / 2, (min(lons) + max(lons)) / 2)


def _projected(at: LatLon, middle: LatLon) -> Xy:
    north = math.radians(at.lat - middle.lat) * _EARTH_M
    east = math.radians(at.lon - middle.lon) * _EARTH_M * math.cos(math.radians(middle.lat))
    return east, north

"""An OpenStreetMap extract (.osm, XML) that somebody has: the buildings, roads and trees in it, in metres.

Format: https://wiki.openstreetmap.org/wiki/OSM_XML. Nothing is fetched.
"""

import io
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Sequence
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
    """`id` as in `way/123`; `outline` in metres about the map's middle, as it was drawn; `tags` as they stand;
    `courtyards`: the inner rings that it has."""

    id: str
    outline: tuple[Xy, ...]
    tags: dict[str, str]
    courtyards: int = 0


class OsmRoad(NamedTuple):
    points: tuple[Xy, ...]
    tags: dict[str, str]


class OsmMap(NamedTuple):
    """`middle` is where (0, 0) lies; `cut_off`: buildings left out, as the extract has not all of their outline."""

    middle: LatLon
    buildings: tuple[OsmBuilding, ...]
    roads: tuple[OsmRoad, ...]
    trees: tuple[Xy, ...]
    cut_off: int

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


class _Multipolygon(NamedTuple):
    """`outers` and `inners`: ids of the ways that its rings are made of."""

    id: str
    outers: tuple[str, ...]
    inners: tuple[str, ...]
    tags: dict[str, str]


class _Raw(NamedTuple):
    nodes: dict[str, LatLon]
    trees: list[LatLon]
    ways: dict[str, _Way]
    multipolygons: list[_Multipolygon]


def read_map(path: Path) -> OsmMap:
    """Raises BadMap."""
    if path.name.endswith(".pbf"):
        raise BadMap(f"{path}: a .pbf is not read; make an .osm of it first, for example with `osmium cat`")
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise BadMap(f"{path} is larger than {MAX_BYTES // 2**20} MiB: take an extract of some streets")
        if b"<!DOCTYPE" in data[:_HEAD_BYTES]:
            raise BadMap(f"{path} declares a document type, which no OpenStreetMap extract does")
        raw = _parsed(data)
    except OSError as error:
        raise BadMap(f"{path}: {error.strerror}") from None
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise BadMap(f"{path} is not an OpenStreetMap extract (XML): {error}") from None
    except (KeyError, ValueError) as error:
        if isinstance(error, BadMap):
            raise
        raise BadMap(f"{path}: an element without its id or place, or with one that is none ({error})") from None
    if not raw.nodes:
        raise BadMap(f"{path} has no nodes: it is no OpenStreetMap extract")
    return _map_of(raw)


def _parsed(data: bytes) -> _Raw:
    raw = _Raw({}, [], {}, [])
    for _, element in ElementTree.iterparse(io.BytesIO(data)):
        if element.tag == "node":
            at = LatLon(float(element.attrib["lat"]), float(element.attrib["lon"]))
            if not (abs(at.lat) <= 90.0 and abs(at.lon) <= 180.0):
                raise ValueError(f"node {element.attrib['id']} at {at.lat:g}, {at.lon:g}")
            raw.nodes[element.attrib["id"]] = at
            if _tags(element).get("natural") == "tree":
                raw.trees.append(at)
        elif element.tag == "way":
            nodes = tuple(child.attrib["ref"] for child in element if child.tag == "nd")
            raw.ways[element.attrib["id"]] = _Way(element.attrib["id"], nodes, _tags(element))
        elif element.tag == "relation":
            if (tags := _tags(element)).get("type") == "multipolygon":
                members = [child for child in element if child.tag == "member" and child.get("type") == "way"]
                outers = tuple(member.attrib["ref"] for member in members if member.get("role") != "inner")
                inners = tuple(member.attrib["ref"] for member in members if member.get("role") == "inner")
                raw.multipolygons.append(_Multipolygon(element.attrib["id"], outers, inners, tags))
        else:
            continue
        element.clear()
    return raw


def _tags(element: ElementTree.Element) -> dict[str, str]:
    return {child.attrib["k"]: child.attrib["v"] for child in element if child.tag == "tag"}


def _map_of(raw: _Raw) -> OsmMap:
    middle = _middle(raw.nodes.values())

    def places(nodes: Iterable[str]) -> tuple[Xy, ...]:
        # an extract may cut a way off: then its last nodes are not in it
        return tuple(_projected(raw.nodes[node], middle) for node in nodes if node in raw.nodes)

    buildings: list[OsmBuilding] = []
    cut_off = 0
    drawn_by_relation: set[str] = set()
    for relation in raw.multipolygons:
        tags = _building_tags(relation, raw.ways)
        if not _is_building(tags):
            continue
        drawn_by_relation.update(relation.outers)
        rings = _rings(relation.outers, raw.ways)
        if rings is None or any(len(places(ring)) < len(ring) for ring in rings):
            cut_off += 1
            continue
        courtyards = [places(ring) for ring in _rings(relation.inners, raw.ways) or ()]
        for number, ring in enumerate(rings, 1):
            name = f"relation/{relation.id}" + (f"-{number}" if len(rings) > 1 else "")
            outline = places(ring[:-1])
            buildings.append(OsmBuilding(name, outline, tags, sum(_inside(yard, outline) for yard in courtyards)))
    for way in raw.ways.values():
        if way.closed and _is_building(way.tags) and way.id not in drawn_by_relation:
            if len(places(way.nodes)) == len(way.nodes):
                buildings.append(OsmBuilding(f"way/{way.id}", places(way.nodes[:-1]), way.tags))
            else:
                cut_off += 1
    drawn = [(places(way.nodes), way.tags) for way in raw.ways.values() if "highway" in way.tags]
    roads = tuple(OsmRoad(points, tags) for points, tags in drawn if len(points) > 1)
    trees = tuple(_projected(tree, middle) for tree in raw.trees)
    return OsmMap(middle, tuple(buildings), roads, trees, cut_off)


def _is_building(tags: dict[str, str]) -> bool:
    return tags.get("building", "no") != "no"


def _inside(ring: Sequence[Xy], outline: Sequence[Xy]) -> bool:
    from shapely import Polygon  # heavy, and only needed here

    return len(ring) > 3 and bool(Polygon(outline).buffer(0).covers(Polygon(ring).representative_point()))


def _building_tags(relation: _Multipolygon, ways: dict[str, _Way]) -> dict[str, str]:
    """Those of the relation, or, as older maps have them, of its only outer way."""
    if "building" not in relation.tags and len(relation.outers) == 1 and relation.outers[0] in ways:
        return ways[relation.outers[0]].tags
    return relation.tags


def _rings(members: Sequence[str], ways: dict[str, _Way]) -> list[tuple[str, ...]] | None:
    """The closed rings of nodes (the first again at the end) that these ways make, joined at their ends in whatever
    order and direction they were drawn; None where one is not in the extract or they do not close."""
    if not members or any(member not in ways for member in members):
        return None
    left = [ways[member].nodes for member in members]
    rings = []
    while left:
        ring = left.pop(0)
        while ring[:1] != ring[-1:]:
            following = next((way for way in left if ring[-1] in (way[:1] + way[-1:])), None)
            if following is None:
                return None
            left.remove(following)
            ring += following[1:] if following[0] == ring[-1] else following[-2::-1]
        if len(ring) < 4:
            return None
        rings.append(ring)
    return rings


def _middle(places: Iterable[LatLon]) -> LatLon:
    lats, lons = zip(*places, strict=True)
    return LatLon((min(lats) + max(lats)) / 2, (min(lons) + max(lons)) / 2)


def _projected(at: LatLon, middle: LatLon) -> Xy:
    north = math.radians(at.lat - middle.lat) * _EARTH_M
    east = math.radians(at.lon - middle.lon) * _EARTH_M * math.cos(math.radians(middle.lat))
    return east, north

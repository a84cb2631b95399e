"""Scenes from OpenStreetMap extracts: what is taken, what is assumed, what is refused."""

import math
from collections.abc import Sequence
from pathlib import Path

import pytest

from contracts.scene import WindowPlace
from contracts.scene_layout import floor_outline
from evaluation.own_scenes.osm_file import BadMap, LatLon, read_map
from evaluation.own_scenes.osm_scene import Thing, Wanted, scene_of
from evaluation.own_scenes.starts import faced_wall

LAT_M, LON_M = 1 / 111_195.08, 1 / (111_195.08 * math.cos(math.radians(52.5)))


class Extract:
    """Written as OpenStreetMap does; places in metres east and north of (52.5, 13.4)."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.nodes = 0

    def node(self, x: float, y: float, tags: str = "") -> str:
        self.nodes += 1
        place = f'lat="{52.5 + y * LAT_M:.9f}" lon="{13.4 + x * LON_M:.9f}"'
        self.lines.append(f'<node id="{self.nodes}" {place}>{tags}</node>')
        return str(self.nodes)

    def way(self, number: int, points: list[tuple[float, float]], closed: bool = True, **tags: str) -> "Extract":
        refs = [self.node(*point) for point in points]
        told = "".join(f'<nd ref="{ref}"/>' for ref in [*refs, *(refs[:1] if closed else [])])
        self.lines.append(f'<way id="{number}">{told}{tags_of(tags)}</way>')
        return self

    def write(self, folder: Path) -> Path:
        path = folder / "street.osm"
        path.write_text(f'<osm version="0.6">{"".join(self.lines)}</osm>', encoding="utf-8")
        return path


def tags_of(tags: dict[str, str]) -> str:
    return "".join(f'<tag k="{key.replace("__", ":")}" v="{value}"/>' for key, value in tags.items())


def box(x: float, y: float, wide: float = 20.0, deep: float = 12.0) -> list[tuple[float, float]]:
    return [(x, y), (x, y + deep), (x + wide, y + deep), (x + wide, y)]  # clockwise, as many ways are drawn


def street() -> Extract:
    """Two houses wall to wall, one across the street, a road, a tree."""
    made = Extract()
    made.way(100, box(0, 0), building="apartments", building__levels="5", addr__street="Weg", addr__housenumber="7")
    made.way(101, box(20, 0), building="apartments", height="13 m", building__colour="#AA3322")
    made.way(102, box(0, 45), building="house")
    made.way(103, [(-60, -20), (80, -20)], closed=False, highway="residential", width="8")
    made.way(104, [(-60, -30), (80, -30)], closed=False, highway="footway")
    made.node(-12.0, -14.0, tags_of({"natural": "tree"}))
    return made


def test_footprints_levels_colours_roads_and_trees_are_taken(tmp_path: Path) -> None:
    made = scene_of(read_map(street().write(tmp_path)), Wanted("street", target="100"))
    scene = made.scene
    by_id = {building.id: building for building in scene.buildings}
    assert scene.target == "way-100"
    assert {name: b.floors for name, b in by_id.items()} == {"way-100": 5, "way-101": 4, "way-102": 3}
    assert by_id["way-101"].style.wall_colour == "#aa3322"
    assert by_id["way-102"].kind == "villa"
    xs, ys = zip(*floor_outline(by_id["way-100"], 1), strict=True)
    assert (max(xs) - min(xs), max(ys) - min(ys)) == pytest.approx((20.0, 12.0), abs=0.05)
    assert [road.width_m for road in scene.ground.roads] == [8.0]
    assert len(scene.ground.trees) == 1
    assert made.told[0] == "delivers to way/100 (Weg 7): 5 floors, 4 walls"
    assert "1 of the map's 3 buildings tell no levels: 3 are taken" in made.told


def test_the_drone_starts_in_the_open_and_faces_the_target(tmp_path: Path) -> None:
    scene = scene_of(read_map(street().write(tmp_path)), Wanted("street", target="way/101")).scene
    start = scene.start.position
    wall = faced_wall(scene, (start.x, start.y), scene.start.yaw)
    assert wall is not None
    assert wall.building == "way-101"
    assert 6.0 <= wall.away_m <= 14.0


@pytest.mark.parametrize("seed", range(6))
def test_the_window_is_never_in_a_wall_that_two_houses_share(tmp_path: Path, seed: int) -> None:
    wanted = Wanted("street", target="100", thing=Thing("flower_pot", "red", 4), seed=seed)
    scene = scene_of(read_map(street().write(tmp_path)), wanted).scene
    place = scene.objects[0].place
    assert isinstance(place, WindowPlace)
    assert (scene.goal, place.floor) == ("goal", 4)
    target = scene.building(scene.target)
    a, b = target.footprint[place.facade], target.footprint[(place.facade + 1) % 4]
    assert not (a.x > 9.0 and b.x > 9.0)


def test_the_building_nearest_to_a_place_or_to_the_middle_is_taken(tmp_path: Path) -> None:
    found = read_map(street().write(tmp_path))
    north = LatLon(52.5 + 50 * LAT_M, 13.4 + 10 * LON_M)
    assert scene_of(found, Wanted("street", at=north)).scene.target == "way-102"
    assert scene_of(found, Wanted("street", around_m=5.0)).scene.target == "way-100"


def relation(number: int, outers: list[int], inners: Sequence[int] = (), **tags: str) -> str:
    members = [(way, "outer") for way in outers] + [(way, "inner") for way in inners]
    told = "".join(f'<member type="way" ref="{way}" role="{role}"/>' for way, role in members)
    return f'<relation id="{number}">{told}{tags_of({"type": "multipolygon"} | tags)}</relation>'


def test_what_is_no_building_is_left_out_and_said(tmp_path: Path) -> None:
    made = street().way(200, [(60, 0), (70, 10), (70, 0), (60, 10)], building="yes")
    made.lines.append(relation(9, [1, 2], building="yes"))
    told = scene_of(read_map(made.write(tmp_path)), Wanted("street", target="100")).told
    assert told[-1] == "left out: 1 building of which the map has a part, 1 with an outline that is none"


def test_an_outline_in_several_ways_is_put_together_in_whatever_direction_they_were_drawn(tmp_path: Path) -> None:
    made = Extract()
    corners = [made.node(*corner) for corner in box(0, 0, 30, 20)]
    for number, refs in ((1, corners[:3]), (2, [corners[0], corners[3]]), (3, corners[2:])):
        made.lines.append(f'<way id="{number}">{"".join(f"""<nd ref="{ref}"/>""" for ref in refs)}</way>')
    made.lines.append(relation(9, [1, 2, 3], building="school"))
    scene = scene_of(read_map(made.write(tmp_path)), Wanted("school", target="9")).scene
    xs, ys = zip(*floor_outline(scene.buildings[0], 1), strict=True)
    assert scene.target == "relation-9"
    assert (max(xs) - min(xs), max(ys) - min(ys)) == pytest.approx((30.0, 20.0), abs=0.05)


def test_a_courtyard_is_built_over_and_said(tmp_path: Path) -> None:
    made = street().way(1, box(0, 90, 40, 30)).way(2, box(10, 100, 20, 10)).way(3, box(60, 90))
    made.lines.append(relation(9, [1, 3], [2], building="yes"))
    found = read_map(made.write(tmp_path))
    assert {building.id: building.courtyards for building in found.buildings if "relation" in building.id} == {
        "relation/9-1": 1,
        "relation/9-2": 0,
    }
    told = scene_of(found, Wanted("block", target="relation/9-1")).told
    assert "relation/9-1 has 1 courtyard: built over, so no window looks into it" in told
    told = scene_of(found, Wanted("block", target="way/102")).told
    assert "1 other building with a courtyard, built over as well" in told


def test_an_outer_way_with_the_tags_of_its_building_is_one_building(tmp_path: Path) -> None:
    made = Extract().way(1, box(0, 0, 40, 30), building="yes", building__levels="6").way(2, box(10, 10, 20, 10))
    made.lines.append(relation(9, [1], [2]))
    found = read_map(made.write(tmp_path))
    assert [(b.id, b.courtyards, b.tags["building:levels"]) for b in found.buildings] == [("relation/9", 1, "6")]


def test_a_round_outline_is_built_with_as_many_corners_as_can_be(tmp_path: Path) -> None:
    turns = [math.tau * k / 90 for k in range(90)]
    made = Extract().way(1, [(12 * math.cos(t), 12 * math.sin(t)) for t in turns], building="yes")
    scene = scene_of(read_map(made.write(tmp_path)), Wanted("tower")).scene
    assert 8 <= len(scene.buildings[0].footprint) <= 32


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("<osm>", "is not an OpenStreetMap extract"),
        ("no xml", "is not an OpenStreetMap extract"),
        ("<osm></osm>", "has no nodes"),
        ('<osm><node id="1" lat="north" lon="1"/></osm>', "could not convert string to float: 'north'"),
        ('<osm><node id="1" lat="nan" lon="1"/></osm>', "node 1 at nan, 1"),
        ('<osm><node id="1" lat="1" lon="500"/></osm>', "node 1 at 1, 500"),
        ('<osm><node lat="1" lon="1"/></osm>', "without its id"),
        ('<!DOCTYPE osm [<!ENTITY a "b">]><osm></osm>', "declares a document type"),
        ('<osm><node id="1" lat="1" lon="1"/></osm>', "has no buildings"),
    ],
)
def test_a_file_that_is_no_extract_is_refused_with_what_is_wrong(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "map.osm"
    path.write_text(text)
    with pytest.raises(BadMap, match=problem):
        scene_of(read_map(path), Wanted("map"))


def test_what_cannot_be_delivered_to_is_refused_with_what_would_be_right(tmp_path: Path) -> None:
    found = read_map(street().write(tmp_path))
    with pytest.raises(BadMap, match="no building way/7; it has way/100, way/101, way/102"):
        scene_of(found, Wanted("street", target="7"))
    with pytest.raises(BadMap, match="has 5 floors; there is no 6"):
        scene_of(found, Wanted("street", target="100", thing=Thing("flower_pot", "red", 6)))
    walled = Extract().way(1, box(0, 0, 10, 10), building="yes")
    for number, (x, y) in enumerate([(-14, -14), (-14, 11), (11, -14), (-14, -3)], 2):
        walled.way(number, box(x, y, 13 if x < 0 and y == -3 else 40, 13), building="yes")
    (tmp_path / "b").mkdir()
    with pytest.raises(BadMap, match=r"\.pbf is not read"):
        read_map(tmp_path / "map.osm.pbf")

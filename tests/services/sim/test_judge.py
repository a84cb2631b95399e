from collections.abc import Sequence

import pytest

from contracts.geometry import Point2, Point3, Pose
from contracts.scene import Building, FreePlace, Scene, SceneObject, Start, WindowPlace
from contracts.scene_layout import goal_window, window_slot
from contracts.sim import Verdict
from episode_kit.judge import Hit, Thing, judge, nearest_window
from episode_kit.kinematics import Vector
from episode_kit.own_request import claimed_window

POT = Thing(7, (0.0, -5.3, 7.1))
HYDRANT = Thing(8, (9.0, -9.0, 0.5))


class OpenAir:
    """Nothing in the way."""

    def first_hits(self, start: Vector, ends: Sequence[Vector]) -> list[Hit | None]:
        return [None] * len(ends)


class Behind:
    """One thing between the start and each of the ends that `blocked` names, counted over all calls."""

    def __init__(self, part: int, blocked: set[int] | None = None) -> None:
        self._part, self._blocked, self._asked = part, blocked, 0

    def first_hits(self, start: Vector, ends: Sequence[Vector]) -> list[Hit | None]:
        hits = []
        for _ in ends:
            shut = self._blocked is None or self._asked in self._blocked
            hits.append(Hit(self._part, "tree") if shut else None)
            self._asked += 1
        return hits


def scene(goal: str | None = "pot", place: WindowPlace | FreePlace | None = None) -> Scene:
    """A house 10 m square about the origin; facade 0 looks south (outwards -y), windows every 3 m, floors of 3 m."""
    corners = ((-5, -5), (5, -5), (5, 5), (-5, 5))
    pot = place or WindowPlace(building="house", facade=0, floor=3, column=1)
    return Scene(
        name="yard",
        buildings=(
            Building(id="house", kind="low_rise", footprint=tuple(Point2(x=x, y=y) for x, y in corners), floors=4),
        ),
        target="house",
        objects=(
            SceneObject(id="pot", kind="flower-pot", colour="green", place=pot),
            SceneObject(
                id="hydrant", kind="bucket", colour="red", place=FreePlace(position=Point3(x=9.0, y=-9.0, z=0.0))
            ),
        ),
        goal=goal,
        start=Start(position=Point3(x=0, y=-15, z=1.5), yaw=1.57),
    )


def judged(
    x: float,
    y: float,
    z: float,
    *,
    target: Vector | None = None,
    sight: OpenAir | Behind | None = None,
    collided: bool = False,
    world: Scene | None = None,
) -> Verdict:
    things = {"pot": POT, "hydrant": HYDRANT}
    return judge(world or scene(), things, sight or OpenAir(), Pose(x=x, y=y, z=z, yaw=1.57), collided, target, 4)


# the goal's window: facade 0, floor 3, column 1: centre (0, -5, 6 + 0.9 + 0.75)
CENTRE_Z = 7.65


def test_a_stop_before_the_right_window_is_a_delivery() -> None:
    verdict = judged(0.0, -7.0, CENTRE_Z)
    assert verdict == Verdict(
        judged=True,
        delivered=True,
        right_window=True,
        distance_m=2.0,
        in_front=True,
        line_of_sight=True,
        collided=False,
        nearest_window=True,
        aside_deg=0.0,
        steps=4,
    )


def test_just_beyond_three_metres_is_no_delivery() -> None:
    assert judged(0.0, -7.99, CENTRE_Z).delivered
    late = judged(0.0, -8.01, CENTRE_Z)
    assert late.right_window
    assert not late.delivered


@pytest.mark.parametrize(("x", "z"), [(3.0, CENTRE_Z), (-3.0, CENTRE_Z), (0.0, CENTRE_Z + 3), (0.0, CENTRE_Z - 3)])
def test_the_neighbouring_window_is_the_wrong_one(x: float, z: float) -> None:
    verdict = judged(x, -6.0, z)
    assert verdict.right_window is False
    assert not verdict.delivered


def test_the_claimed_place_counts_and_not_where_the_drone_stopped() -> None:
    # the stop is nearly before column 2, the claim is for something in column 1
    assert judged(1.4, -7.0, CENTRE_Z, target=(0.3, -5.2, 7.2)).delivered
    assert judged(1.4, -7.0, CENTRE_Z, target=(2.9, -5.2, 7.2)).right_window is False


@pytest.mark.parametrize(("dx", "dz"), [(-2.9, 0.0), (1.6, 0.0), (0.0, 2.9), (0.0, -1.6), (-2.0, 2.0)])
@pytest.mark.parametrize("out", [0.6, 1.5])
def test_a_stop_nearer_to_another_window_is_no_delivery_whatever_is_claimed(dx: float, dz: float, out: float) -> None:
    verdict = judged(dx, -5.0 - out, CENTRE_Z + dz, target=(0.0, -5.0, CENTRE_Z))
    assert verdict.right_window
    assert verdict.nearest_window is False
    assert not verdict.delivered


def test_a_window_of_another_building_may_be_the_nearest() -> None:
    corners = ((-5, -16), (5, -16), (5, -8), (-5, -8))
    across = Building(id="across", kind="low_rise", footprint=tuple(Point2(x=x, y=y) for x, y in corners), floors=4)
    alley = scene().model_copy(update={"buildings": (*scene().buildings, across)})
    target = (0.0, -5.0, CENTRE_Z)
    assert judged(0.0, -6.4, CENTRE_Z, target=target, world=alley).delivered
    beyond = judged(0.0, -6.6, CENTRE_Z, target=target, world=alley)
    assert (beyond.nearest_window, beyond.delivered) == (False, False)


def test_a_stop_more_than_sixty_degrees_off_the_normal_is_no_delivery() -> None:
    target = (0.0, -5.0, CENTRE_Z)
    near = judged(1.0, -5.0 - 0.6, CENTRE_Z, target=target)
    assert near.aside_deg == pytest.approx(59.04, abs=0.01)
    assert near.delivered
    flat = judged(1.0, -5.0 - 0.5, CENTRE_Z, target=target)
    assert flat.aside_deg == pytest.approx(63.43, abs=0.01)
    assert (flat.nearest_window, flat.in_front, flat.delivered) == (True, True, False)


def test_a_place_on_the_balconys_floor_belongs_to_its_own_floor() -> None:
    # 0.2 m above floor 3 and 1.2 m out: the centre of floor 2's window is nearer than that of floor 3's
    slot = nearest_window(scene(), (0.0, -6.2, 6.2))
    assert slot is not None
    assert (slot.floor, slot.column) == (3, 1)


def test_a_place_on_the_object_itself_is_right_though_a_neighbours_wall_is_nearer() -> None:
    wide = Thing(7, (1.4, -5.1, 7.6))
    verdict = judge(
        scene(),
        {"pot": wide, "hydrant": HYDRANT},
        OpenAir(),
        Pose(x=1.4, y=-7, z=7.6, yaw=0),
        False,
        (1.7, -5.1, 7.6),
        1,
    )
    assert verdict.right_window


def test_behind_the_wall_is_not_in_front() -> None:
    verdict = judged(0.0, -4.0, CENTRE_Z, target=POT.middle)
    assert not verdict.in_front
    assert not verdict.delivered


def test_a_collision_on_the_way_spoils_the_delivery() -> None:
    verdict = judged(0.0, -7.0, CENTRE_Z, collided=True)
    assert verdict.right_window
    assert not verdict.delivered


def test_something_between_hides_the_window() -> None:
    verdict = judged(0.0, -7.0, CENTRE_Z, sight=Behind(part=3))
    assert not verdict.line_of_sight
    assert not verdict.delivered


def test_the_goal_object_does_not_hide_its_own_window() -> None:
    assert judged(0.0, -7.0, CENTRE_Z, sight=Behind(part=POT.part)).delivered


def test_one_bar_before_the_window_does_not_hide_it() -> None:
    assert judged(0.0, -7.0, CENTRE_Z, sight=Behind(3, {3, 4, 5})).delivered
    assert not judged(0.0, -7.0, CENTRE_Z, sight=Behind(3, {0, 1, 2, 3, 4, 9})).delivered


def test_the_object_seen_past_a_parapet_is_enough() -> None:
    assert judged(0.0, -7.0, CENTRE_Z, sight=Behind(3, {0, 1, 2, 3, 4, 5, 6})).delivered


def test_a_goal_on_the_ground_is_judged_by_the_object() -> None:
    free = scene(goal="hydrant")
    assert judged(9.0, -11.0, 1.5, world=free).delivered
    assert judged(9.0, -13.0, 1.5, world=free).delivered is False
    assert judged(0.0, -7.0, CENTRE_Z, world=free).right_window is False
    assert goal_window(free) is None


def test_without_a_goal_only_the_stop_is_checked() -> None:
    verdict = judged(0.0, -7.0, CENTRE_Z, world=scene(goal=None))
    assert not verdict.judged
    assert verdict.right_window is None
    assert verdict.stops_well()
    assert not verdict.delivered
    assert not judged(0.0, -9.0, CENTRE_Z, world=scene(goal=None)).stops_well()


def test_the_goals_window_is_where_its_object_stands() -> None:
    assert goal_window(scene()) == window_slot(scene().building("house"), 0, 3, 1)


def test_for_a_request_of_ones_own_the_verdict_tells_what_stands_at_both_windows() -> None:
    place = WindowPlace(building="house", facade=2, floor=2, column=1)
    yard = scene()
    other = SceneObject(id="other", kind="flower-pot", colour="red", place=place)
    yard = yard.model_copy(update={"objects": (*yard.objects, other)})
    slot = window_slot(yard.building("house"), 2, 2, 1)
    pose = Pose(x=slot.centre[0], y=slot.centre[1] + 2.0, z=slot.centre[2], yaw=-1.57)
    window = claimed_window(yard, {}, OpenAir(), pose, slot.centre, lambda kind, colour: (f"{colour} {kind}",))
    assert window is not None
    assert (window.claimed.floor, window.claimed.names) == (2, ("red flower-pot",))
    assert window.goal is not None
    assert (window.goal.floor, window.goal.names) == (3, ("green flower-pot",))
    assert window.distance_m == pytest.approx(2.0)
    assert (window.in_front, window.line_of_sight, window.nearest_window) == (True, True, True)

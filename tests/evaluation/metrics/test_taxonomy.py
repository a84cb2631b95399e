"""Each reason of the failure taxonomy, and which one goes first."""

import math

import pytest

from contracts.geometry import Pose
from contracts.orchestrator import DeliveryResult
from evaluation.metrics.taxonomy import in_plain_view, plain, reason_of
from tests.evaluation.evaluation_kit import a_result, a_task, a_verdict, delivered, stops

TASK = a_task()
LOOKING_EAST, LOOKING_WEST = 0.0, math.pi
BEFORE_THE_WINDOW = (10.0, -6.0, LOOKING_WEST)
BEHIND_THE_HOUSE = (10.0, 20.0, LOOKING_EAST)
AT_THE_NEIGHBOURS = (52.0, -6.0, LOOKING_EAST)
FAR_AWAY = (-40.0, -6.0, LOOKING_WEST)

CASES: list[tuple[str, DeliveryResult | None]] = [
    ("success", delivered()),
    ("error", None),
    ("error", a_result("failed")),
    ("error", a_result("cancelled")),
    ("collision", a_result("collision")),
    ("unreachable", a_result("model_unreachable")),
    ("unreachable", a_result("service_unreachable", floor=None, object=None, final_height_m=None)),
    ("parse", a_result("request_incomplete", floor=None, final_height_m=None)),
    ("parse", a_result("object_not_found", floor=4)),
    ("parse", a_result("wrong_window", a_verdict(right=False), object="red flower pot")),
    ("unreadable", a_result("request_unreadable", floor=None, object=None, final_height_m=None)),
    ("unreadable", a_result("answer_unreadable")),
    ("unreadable", a_result("object_unknown", final_height_m=None)),
    ("floor", a_result("floor_not_found", final_height_m=None)),
    ("floor", a_result("wrong_window", a_verdict(right=False), final_height_m=15.0)),
    ("floor", a_result("object_not_found", final_height_m=15.0, stops=stops(BEFORE_THE_WINDOW))),
    ("floor", a_result("object_not_found", final_height_m=9.2)),
    ("floor", a_result("object_not_found", final_height_m=5.9, stops=stops(BEFORE_THE_WINDOW))),
    ("timeout", a_result("object_not_found", final_height_m=8.9)),
    ("blocked", a_result("blocked", final_height_m=9.2)),
    ("wrong_object", a_result("wrong_window", a_verdict(right=False))),
    ("wrong_object", a_result("wrong_window", a_verdict(right=False), final_height_m=9.2)),
    ("blocked", a_result("blocked")),
    ("blocked", a_result("blocked", final_height_m=None)),
    ("blocked", a_result("not_in_front", a_verdict(distance_m=4.0))),
    ("missed_object", a_result("object_not_found", stops=stops(BEFORE_THE_WINDOW, AT_THE_NEIGHBOURS))),
    ("lost_building", a_result("object_not_found", stops=stops(BEHIND_THE_HOUSE, AT_THE_NEIGHBOURS))),
    ("lost_building", a_result("object_not_found", stops=stops(FAR_AWAY))),
    ("timeout", a_result("object_not_found", stops=stops(AT_THE_NEIGHBOURS, BEHIND_THE_HOUSE))),
    ("timeout", a_result("object_not_found")),
]


@pytest.mark.parametrize(("reason", "result"), CASES, ids=[f"{i}-{reason}" for i, (reason, _) in enumerate(CASES)])
def test_each_way_to_fail_has_its_reason(reason: str, result: DeliveryResult | None) -> None:
    assert reason_of(TASK, result) == reason


def test_a_collision_goes_before_whatever_led_to_it() -> None:
    assert reason_of(TASK, a_result("collision", floor=4, final_height_m=None)) == "collision"


def test_a_success_stays_one_even_where_the_parser_found_other_words() -> None:
    assert reason_of(TASK, delivered(object="flower pot, green")) == "success"


def test_case_blanks_and_hyphens_tell_no_objects_apart() -> None:
    assert plain("Green Flower-pot") == plain("green flowerpot")
    assert plain("green flower pot") != plain("red flower pot")


@pytest.mark.parametrize(
    ("pose", "seen", "why"),
    [
        ((10.0, -6.0, 7.5, LOOKING_WEST), True, "straight before it"),
        ((10.0, -6.0, 7.5, -math.pi / 2), False, "the drone looks away: no camera behind"),
        ((10.0, -16.0, 7.5, LOOKING_WEST), False, "over 15 m away"),
        ((22.0, -2.0, 7.5, LOOKING_WEST), False, "almost along the wall"),
        ((10.0, -3.0, 1.5, LOOKING_WEST), False, "below the pictures' lower edge"),
        ((10.0, 13.0, 7.5, LOOKING_WEST), False, "behind the house"),
    ],
)
def test_plain_view_is_judged_on_the_plan(pose: tuple[float, float, float, float], seen: bool, why: str) -> None:
    x, y, z, yaw = pose
    assert in_plain_view(TASK, Pose(x=x, y=y, z=z, yaw=yaw)) is seen, why


def test_a_house_between_hides_the_window() -> None:
    task = a_task()
    shed = task.scene.buildings[1].model_copy(update={"id": "shed"})
    corners = tuple(p.model_copy(update={"x": p.x - 60.0, "y": p.y / 4 - 5.0}) for p in shed.footprint)
    between = shed.model_copy(update={"footprint": corners})
    crowded = task.model_copy(
        update={"scene": task.scene.model_copy(update={"buildings": (*task.scene.buildings, between)})}
    )
    pose = Pose(x=10.0, y=-8.0, z=7.5, yaw=LOOKING_WEST)
    assert in_plain_view(task, pose)
    assert not in_plain_view(crowded, pose)

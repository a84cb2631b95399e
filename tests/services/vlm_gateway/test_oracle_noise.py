"""The oracle's faults: as often as asked for, the same ones for two policies at the same stop, none unasked."""

import pytest

from contracts.geometry import Box, Pose
from contracts.sim import Truth, TruthView, VisibleObject
from service_kit.settings import BadSetting
from services.vlm_gateway.backends.noise import Count, Faults
from services.vlm_gateway.model_configs import NO_NOISE, OracleNoise
from services.vlm_gateway.settings import GatewaySettings

BOX = Box(x_min=0.4, y_min=0.4, x_max=0.5, y_max=0.6)
WALL = Box(x_min=0.1, y_min=0.0, x_max=0.9, y_max=0.8)
STOPS = 1500


def truth(moves: int = 0, scene: str = "task-1", *objects: VisibleObject) -> Truth:
    view = TruthView(camera="front", objects=objects, building_box=WALL, floors_visible=3, floor_rows=(0.8, 0.5, 0.2))
    return Truth(scene=scene, moves=moves, pose=Pose(x=0, y=0, z=5, yaw=0), views=(view,), remaining_m=())


def thing(*, goal: bool) -> VisibleObject:
    return VisibleObject(id="t", kind="vase", colour="red", goal=goal, box=BOX, pixels=400, share=0.9, distance_m=8.0)


@pytest.mark.parametrize(("rate", "fault"), [("miss_rate", "misses"), ("refusal_rate", "refuses")])
def test_faults_come_as_often_as_asked_for(rate: str, fault: str) -> None:
    noise = OracleNoise(**{rate: 0.3})
    share = sum(getattr(Faults(noise, truth(n), "recognition", "0"), fault) for n in range(STOPS)) / STOPS
    assert share == pytest.approx(0.3, abs=0.03)


def test_the_same_stop_meets_the_same_fault_whatever_came_before() -> None:
    noise = OracleNoise(miss_rate=0.5, box_jitter=0.2, seed=3)
    first = [(f.misses, f.jittered(BOX)) for f in (Faults(noise, truth(n), "recognition", "45") for n in range(50))]
    again = [
        (f.misses, f.jittered(BOX)) for f in (Faults(noise, truth(n), "recognition", "45") for n in range(49, -1, -1))
    ]
    assert first == again[::-1]
    assert len({missed for missed, _ in first}) == 2


@pytest.mark.parametrize("other", [{"moves": 1}, {"scene": "task-2"}])
def test_other_stops_scenes_views_and_seeds_meet_other_faults(other: dict[str, object]) -> None:
    noise = OracleNoise(box_jitter=0.2)
    here = Faults(noise, truth(), "recognition", "0").jittered(BOX)
    assert Faults(noise, truth(**other), "recognition", "0").jittered(BOX) != here  # type: ignore[arg-type]
    assert Faults(noise, truth(), "recognition", "45").jittered(BOX) != here
    assert Faults(noise.model_copy(update={"seed": 1}), truth(), "recognition", "0").jittered(BOX) != here


def test_one_rate_does_not_move_the_faults_of_another() -> None:
    alone = [Faults(OracleNoise(miss_rate=0.4), truth(n), "recognition", "0").misses for n in range(200)]
    noisy = OracleNoise(miss_rate=0.4, refusal_rate=0.5, false_claim_rate=0.5)
    assert [Faults(noisy, truth(n), "recognition", "0").misses for n in range(200)] == alone


def test_a_miscount_is_off_by_one_and_its_rows_go_along() -> None:
    right = Count(3, (0.2, 0.5, 0.8))
    counts = [
        Faults(OracleNoise(floor_miscount_rate=1.0), truth(n), "floors", "0").miscounted(right) for n in range(50)
    ]
    assert {c.floors for c in counts} == {2, 4}
    assert [len(c.rows) for c in counts] == [c.floors for c in counts]
    assert all(list(c.rows) == sorted(c.rows) for c in counts)
    assert Faults(OracleNoise(floor_miscount_rate=1.0), truth(), "floors", "0").miscounted(Count(0, ())) == Count(
        1, (0.5,)
    )


def test_a_false_claim_is_another_thing_or_a_piece_of_wall() -> None:
    noise = OracleNoise(false_claim_rate=1.0)
    faults = Faults(noise, truth(), "recognition", "0")
    other = faults.false_match(truth(0, "s", thing(goal=True), thing(goal=False)).views)
    assert other is not None
    assert other.box == BOX
    wall = faults.false_match(truth(0, "s", thing(goal=True)).views)
    assert wall is not None
    assert wall.box != BOX
    assert WALL.x_min <= wall.box.x_min < wall.box.x_max <= WALL.x_max


@pytest.mark.parametrize("moves", range(30))
def test_jittered_boxes_stay_boxes_inside_the_picture(moves: int) -> None:
    edge = Box(x_min=0.99, y_min=0.0, x_max=1.0, y_max=0.01)
    off = Faults(OracleNoise(box_jitter=1.0), truth(moves), "recognition", "0").jittered(edge)
    assert 0.0 <= off.x_min < off.x_max <= 1.0
    assert 0.0 <= off.y_min < off.y_max <= 1.0


def test_without_noise_nothing_is_wrong() -> None:
    for n in range(200):
        faults = Faults(NO_NOISE, truth(n), "recognition", "0")
        assert not (faults.misses)
        assert not (faults.refuses)
        assert not (faults.claims_falsely)
        assert faults.jittered(BOX) == BOX
        assert faults.miscounted(Count(3, (0.2, 0.5, 0.8))).floors == 3


def test_a_rate_above_one_is_a_bad_setting() -> None:
    with pytest.raises(BadSetting, match="ORACLE_MISS_RATE"):
        GatewaySettings.read({"ORACLE_SIM_URL": "http://127.0.0.1:1", "ORACLE_MISS_RATE": "1.5"})

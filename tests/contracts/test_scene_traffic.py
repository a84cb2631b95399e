"""Traffic in a scene document."""

from typing import Any

import pytest
from pydantic import ValidationError

from contracts.scene import Scene
from contracts.scene_traffic import MAX_MOVERS
from tests.services.sim.conftest import make_yard

WALK = [{"x": -8, "y": -9}, {"x": 8, "y": -9}]


def with_traffic(*movers: dict[str, Any]) -> Scene:
    return Scene.model_validate(make_yard().model_dump(mode="json") | {"traffic": list(movers)})


def test_a_scene_without_traffic_is_written_as_it_was_before_there_was_any() -> None:
    assert "traffic" not in make_yard().model_dump(mode="json")


def test_traffic_survives_its_json() -> None:
    scene = with_traffic(
        {"kind": "person", "id": "anna", "way": WALK, "phase": 0.5},
        {"kind": "car", "id": "taxi", "way": WALK, "speed_m_s": 6},
        {
            "kind": "bird",
            "id": "crow",
            "way": [{"x": 0, "y": 0, "z": 9}, {"x": 9, "y": 0, "z": 9}, {"x": 9, "y": 9, "z": 8}],
        },
    )
    assert [mover.kind for mover in scene.traffic] == ["person", "car", "bird"]
    assert Scene.model_validate_json(scene.model_dump_json()) == scene


@pytest.mark.parametrize(
    ("movers", "said"),
    [
        ([{"kind": "dog", "id": "rex", "way": WALK}], "'person', 'car', 'bird'"),
        ([{"kind": "person", "id": "anna", "way": WALK[:1]}], "at least 2 items"),
        ([{"kind": "person", "id": "anna", "way": WALK[:1] * 2}], "leg 0 of the way is 0.00 m long"),
        ([{"kind": "person", "id": "anna", "way": WALK, "speed_m_s": 9}], "less than or equal to 3"),
        ([{"kind": "person", "id": "anna", "way": WALK}] * 2, "more than one mover is called anna"),
        ([{"kind": "bird", "id": "crow", "way": WALK}], "z"),
        (
            [{"kind": "bird", "id": "crow", "way": [{**point, "z": -5.0} for point in (*WALK, {"x": 0.5, "y": 9.5})]}],
            "birds fly 1 to 100 m above ground, not at -5 m",
        ),
        ([{"kind": "car", "id": f"car-{k}", "way": WALK} for k in range(MAX_MOVERS + 1)], "at most 60 items"),
    ],
)
def test_traffic_out_of_its_bounds_is_refused_and_told_why(movers: list[dict[str, Any]], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        with_traffic(*movers)

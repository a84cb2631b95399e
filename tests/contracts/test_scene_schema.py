"""docs/scene.schema.json: what editors and programs are told of a scene is what the service takes."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from pydantic import ValidationError

from contracts.scene import SCHEMA_KEY, Scene
from contracts.scene_schema import json_schema, schema_text

ROOT = Path(__file__).parents[2]
SAMPLES = sorted((ROOT / "orchestrator" / "samples").glob("*.json"))
CHECK = jsonschema.Draft202012Validator(json_schema())


def scene_of(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8"))["scene"])


def test_the_schema_in_the_documents_is_the_one_of_the_contract() -> None:
    assert (ROOT / "docs" / "scene.schema.json").read_text(encoding="utf-8") == schema_text(), "run `make schema`"


@pytest.mark.parametrize("path", SAMPLES, ids=lambda p: p.stem)
def test_every_sample_is_a_scene_by_the_schema(path: Path) -> None:
    assert [error.message for error in CHECK.iter_errors(scene_of(path))] == []


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"target": 7}, "is not of type 'string'"),
        ({"weather": "rain"}, "weather"),
        ({"light": {"sky": "green"}}, "green"),
        ({"ground": {"half_size_m": 5}}, "5"),
        ({"start": {"position": {"x": 0, "y": 0, "z": 1}}}, "yaw"),
    ],
)
def test_what_the_schema_refuses_the_contract_refuses_too(change: dict[str, Any], where: str) -> None:
    changed = scene_of(SAMPLES[0]) | change
    assert any(where in error.message for error in CHECK.iter_errors(changed))
    with pytest.raises(ValidationError):
        Scene.model_validate(changed)


def test_a_scene_may_name_its_schema_and_is_the_same_scene() -> None:
    plain = scene_of(SAMPLES[0])
    named = {SCHEMA_KEY: "./scene.schema.json"} | plain
    assert Scene.model_validate_json(json.dumps(named)) == Scene.model_validate(plain)
    assert CHECK.is_valid(named)
    assert SCHEMA_KEY not in Scene.model_validate(named).model_dump_json()

"""The JSON Schema of a scene document. `python -m contracts.scene_schema` prints it: docs/scene.schema.json."""

import json
import sys
from typing import Any

from contracts.scene import SCHEMA_KEY, Scene


def json_schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of a scene document, for editors and for programs that write one."""
    schema = _in_one_line(Scene.model_json_schema())
    named = {SCHEMA_KEY: {"type": "string", "description": "Where this schema is, for editors."}}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "A scene of LogisticsVLN",
        "properties": named | schema["properties"],
    }


def _in_one_line(schema: Any) -> Any:
    """The same schema, its descriptions without line breaks."""
    if isinstance(schema, list):
        return [_in_one_line(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        key: " ".join(value.split()) if key == "description" and isinstance(value, str) else _in_one_line(value)
        for key, value in schema.items()
    }


def schema_text() -> str:
    """`json_schema` as the text of a file."""
    return json.dumps(json_schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    sys.stdout.write(schema_text())

"""The closed form of each answer: as JSON schema for servers that hold models to it, and as a reader for all others.

Whatever a server promises, every answer goes through the reader.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

from contracts.geometry import Box, PointLabel
from contracts.vlm_gateway import Match
from services.vlm_gateway.backends.base import AskedView, Building, Direction, Floors, Sightings
from services.vlm_gateway.chat.boxes import BadBox, Size, in_words, numbers_by_name, scale, to_unit
from services.vlm_gateway.presets import BoxOrder, BoxStyle

T = TypeVar("T")
MAX_MATCHES = 25


class Unreadable(ValueError):
    """An answer that is not of the closed form; the message is fit for the repair question."""


class Declined(Exception):
    """The form's own way of saying that there is no answer."""


class BoxForm(NamedTuple):
    """How this model writes boxes, and what one picture's far corner is in its numbers."""

    key: str
    style: BoxStyle
    order: BoxOrder
    factor: int
    min_pixels: int
    max_pixels: int

    def full(self, sent: Size) -> tuple[float, float]:
        return scale(self.style, sent, self.factor, self.min_pixels, self.max_pixels)

    def in_words(self, sent: Size) -> str:
        return in_words(self.style, self.order, self.full(sent))

    def read(self, value: object, sent: Size) -> Box:
        """Raises Unreadable."""
        if isinstance(value, list) and len(value) == 1 and isinstance(value[0], list):
            value = value[0]  # InternVL's nested lists
        if not isinstance(value, list):
            raise Unreadable(f'"{self.key}" must be a list of four numbers')
        numbers = [_number(entry, f'"{self.key}"') for entry in value]
        try:
            return to_unit(numbers, self.order, self.full(sent))
        except BadBox as error:
            raise Unreadable(f'"{self.key}": {error}') from None


class Form(NamedTuple):
    """`name` and `schema` are for structured output; `example` is shown in the prompt, with placeholders instead of
    values, because small models repeat the values they are shown."""

    name: str
    schema: dict[str, object]
    example: str


def floors_form() -> Form:
    schema = _object({"floors": {"type": "integer", "minimum": 0, "maximum": 100}})
    return Form("floor_count", schema, '{"floors": <whole number>}')


def read_floors(value: object) -> Floors:
    """Raises Unreadable or Declined."""
    if isinstance(value, dict):
        value = _fields(value, {"floors"}, set())["floors"]
    if value is None:
        raise Declined
    count = _number(value, '"floors"')
    if count != int(count) or not 0 <= count <= 100:
        raise Unreadable('"floors" must be a whole number from 0 to 100')
    return Floors(int(count), None)


def building_form(boxes: BoxForm) -> Form:
    schema = _object({boxes.key: {"anyOf": [_box_schema(), {"type": "null"}]}})
    return Form("building_box", schema, f'{{"{boxes.key}": {numbers_by_name(boxes.order)}}} or {{"{boxes.key}": null}}')


def read_building(value: object, boxes: BoxForm, sent: Size) -> Building:
    """Raises Unreadable."""
    if isinstance(value, list) and len(value) == 1 and isinstance(value[0], dict):
        value = _without_label(value[0])  # as detection-trained models write it
    box = _fields(value, {boxes.key}, set())[boxes.key]
    return Building(None if box is None else boxes.read(box, sent))


def find_form(boxes: BoxForm, views: int) -> Form:
    match = _object(
        {
            "view": {"type": "integer", "minimum": 1, "maximum": views},
            boxes.key: _box_schema(),
            "confidence": {"type": "number", "minimum": 0, "maximum": 1},
        }
    )
    schema = _object({"found": {"type": "boolean"}, "matches": {"type": "array", "items": match}})
    match_example = f'{{"view": <number>, "{boxes.key}": {numbers_by_name(boxes.order)}, "confidence": <0.0 to 1.0>}}'
    example = f'{{"found": true, "matches": [{match_example}]}}'
    return Form("object_search", schema, example + ' or {"found": false, "matches": []}')


def read_find(value: object, boxes: BoxForm, views: Sequence[AskedView]) -> Sightings:
    """Raises Unreadable."""
    if isinstance(value, list):
        # detection-trained models leave the wrapping out and write the list of boxes
        value = {"found": bool(value), "matches": [_without_label(entry) for entry in value]}
    fields = _fields(value, {"found"}, {"matches"})
    entries = fields.get("matches", [])
    if not isinstance(fields["found"], bool) or not isinstance(entries, list):
        raise Unreadable('"found" must be true or false and "matches" a list')
    if fields["found"] != bool(entries):
        raise Unreadable('"found" must be true exactly when "matches" is not empty')
    matches = [_match(entry, boxes, views) for entry in entries[:MAX_MATCHES]]
    return Sightings(tuple(sorted(matches, key=lambda match: -match.confidence)))


def choice_form(labels: Sequence[PointLabel]) -> Form:
    schema = _object({"label": {"type": "string", "enum": list(labels)}})
    return Form("direction", schema, f'{{"label": "<one of {", ".join(labels)}>"}}')


def read_choice(value: object, labels: Sequence[PointLabel]) -> Direction:
    """Raises Unreadable."""
    if isinstance(value, dict):
        value = _fields(value, {"label"}, set())["label"]
    given = value.strip().lower() if isinstance(value, str) else None
    for label in labels:
        if given == label:
            return Direction(label)
    raise Unreadable(f'"label" must be one of {", ".join(labels)}')


def first_readable(values: Sequence[object], read: Callable[[object], T]) -> T:
    """The first value that has the form. Raises Unreadable (the first value's reason) or Declined."""
    problem: Unreadable | None = None
    for value in values:
        try:
            return read(value)
        except Unreadable as error:
            problem = problem or error
    raise problem or Unreadable("there is no JSON in the answer")


def _match(entry: object, boxes: BoxForm, views: Sequence[AskedView]) -> Match:
    optional = {"confidence", "view"} if len(views) == 1 else {"confidence"}
    fields = _fields(entry, {boxes.key} | ({"view"} - optional), optional)
    number = _number(fields.get("view", 1), '"view"')
    if number != int(number) or not 1 <= number <= len(views):
        raise Unreadable(f'"view" must be a whole number from 1 to {len(views)}')
    confidence = _number(fields.get("confidence", 1.0), '"confidence"')
    if not 0.0 <= confidence <= 1.0:
        raise Unreadable('"confidence" must be from 0 to 1')
    view = views[int(number) - 1]
    box = boxes.read(fields[boxes.key], Size(view.picture.width, view.picture.height))
    return Match(camera=view.camera.name, box=box, confidence=confidence)


def _without_label(entry: object) -> object:
    return {key: value for key, value in entry.items() if key != "label"} if isinstance(entry, dict) else entry


def _fields(value: object, needed: set[str], optional: set[str]) -> dict[str, object]:
    if not isinstance(value, dict):
        raise Unreadable(f"a JSON object with {_quoted(needed)} is wanted")
    if missing := needed - set(value):
        raise Unreadable(f"{_quoted(missing)} is missing")
    if unknown := set(value) - needed - optional:
        raise Unreadable(f"{_quoted({str(key)[:40] for key in unknown})} does not belong there")
    return value


def _number(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or abs(value) > 1e9:
        raise Unreadable(f"{what} must hold numbers")
    return float(value)


def _quoted(keys: set[str]) -> str:
    return ", ".join(f'"{key}"' for key in sorted(keys))


def _object(properties: dict[str, object]) -> dict[str, object]:
    # every property required and none beyond them: the only kind that strict servers take
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}


def _box_schema() -> dict[str, object]:
    return {"type": "array", "items": {"type": "number"}, "minItems": 4, "maxItems": 4}

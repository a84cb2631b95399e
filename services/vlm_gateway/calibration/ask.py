"""A calibration of one of the gateway's models, over HTTP as any client would do it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from contracts.images import encode_jpeg
from service_kit.client import CallError, ServiceClient
from services.vlm_gateway.calibration.fit import Certainty, Convention, Fit, Order, Pair, Scale, fit
from services.vlm_gateway.calibration.picture import ShapePicture, draw
from services.vlm_gateway.calibration.reading import boxes_in

SEED = 20_000
MAX_TOKENS = 4096
_KEYS = ("bbox_2d", "box_2d", "bbox")


class _Lenient(BaseModel):
    model_config = ConfigDict(extra="ignore")


class _Message(_Lenient):
    content: str | list[dict[str, Any]] | None = None


class _Choice(_Lenient):
    message: _Message


class _Completion(_Lenient):
    choices: list[_Choice] = []


class _Configured(_Lenient):
    """What `/v1/status` says of a chat model, as far as it matters here."""

    preset: str | None = None
    boxes: str | None = None
    box_order: str | None = None
    box_key: str | None = None
    image_factor: int | None = None


class _Status(_Lenient):
    models: dict[str, _Configured] = {}


class _Chat(BaseModel):
    """Just warm enough that a gateway does not answer out of its cache: what the model says now is wanted."""

    model: str
    messages: list[dict[str, Any]]
    temperature: float = 0.01
    max_tokens: int = MAX_TOKENS


class Calibration(BaseModel):
    """What was found. `config` is what the model's table of the gateway's file should say; empty where that is not
    known. `agrees` says whether the gateway is configured so; null where it does not tell or nothing was found."""

    model: str
    certainty: Certainty
    boxes: Scale | None
    box_order: Order | None
    image_factor: int | None
    full: tuple[float, float] | None
    overlap: float
    rival: str
    rival_overlap: float
    shapes_told: int
    shapes_shown: int
    config: str
    configured: dict[str, object] | None
    agrees: bool | None
    first_answer: str


async def calibrate(client: ServiceClient, model: str, rounds: int) -> Calibration:
    """Shows `model` that many pictures. Raises CallError where the gateway or the model can't be reached."""
    configured = await _configured(client, model)
    key = configured.box_key if configured and configured.box_key in _KEYS else _KEYS[0]
    pairs: list[Pair] = []
    first_answer = ""
    for number in range(rounds):
        picture = draw(np.random.default_rng(SEED + number))
        answer = await _answer(client, model, picture, key)
        first_answer = first_answer or answer
        told = {one.colour: one.numbers for one in boxes_in(answer)}
        pairs += [Pair(shape.box, told.get(shape.colour)) for shape in picture.shapes]
    return _calibration(model, fit(pairs), configured, first_answer)


def question(key: str) -> str:
    """Asks for boxes without saying how to write them: the model's own habit is what is wanted."""
    return (
        "The picture shows six coloured shapes on a light background. Detect each of them. Answer with JSON only: a "
        f'list with one object for each shape, {{"{key}": [four numbers], "label": "<colour and shape>"}}. Write the '
        "four numbers of a bounding box the way you were trained to."
    )


async def _answer(client: ServiceClient, model: str, picture: ShapePicture, key: str) -> str:
    url = "data:image/jpeg;base64," + encode_jpeg(picture.rgb, quality=95).jpeg_base64
    content = [{"type": "image_url", "image_url": {"url": url}}, {"type": "text", "text": question(key)}]
    chat = _Chat(model=model, messages=[{"role": "user", "content": content}])
    completion = await client.call("POST", "/v1/chat/completions", _Completion, chat)
    if not completion.choices:
        return ""
    said = completion.choices[0].message.content
    if isinstance(said, list):
        return "".join(str(part.get("text", "")) for part in said)
    return said or ""


async def _configured(client: ServiceClient, model: str) -> _Configured | None:
    """None where the gateway keeps its status to itself; a wrong name is told by the first question."""
    try:
        status = await client.call("GET", "/v1/status", _Status)
    except CallError:
        return None
    return status.models.get(model)


def _calibration(model: str, found: Fit, configured: _Configured | None, first_answer: str) -> Calibration:
    best = found.best.convention if found.certainty != "none" else None
    usable = best is not None and best.scale != "other"
    config = _config_lines(best) if best is not None and usable else ""
    agrees: bool | None = None
    if best is not None and usable and configured is not None and configured.boxes is not None:
        agrees = (configured.boxes, configured.box_order) == (best.scale, best.order)
        if best.factor is not None:
            agrees = agrees and configured.image_factor == best.factor
    return Calibration(
        model=model,
        certainty=found.certainty,
        boxes=best.scale if best else None,
        box_order=best.order if best else None,
        image_factor=best.factor if best else None,
        full=best.full if best else None,
        overlap=round(found.best.overlap, 3),
        rival=in_words(found.rival.convention),
        rival_overlap=round(found.rival.overlap, 3),
        shapes_told=found.told,
        shapes_shown=found.shown,
        config=config,
        configured=configured.model_dump(exclude_none=True) if configured else None,
        agrees=agrees,
        first_answer=first_answer[:2000],
    )


def _config_lines(convention: Convention) -> str:
    lines = [f'boxes = "{convention.scale}"', f'box_order = "{convention.order}"']
    if convention.factor is not None:
        lines.append(f"image_factor = {convention.factor}")
    return "\n".join(lines)


_SCALES: dict[Scale, str] = {
    "unit": "0..1",
    "thousand": "0..1000",
    "pixels": "pixels of the picture as sent",
    "resized_pixels": "pixels of the picture as resized by its processor",
}


def in_words(convention: Convention) -> str:
    """Order and scale for a person."""
    full_x, full_y = convention.full
    scale = _SCALES.get(convention.scale) or f"numbers up to about {full_x:.4g} x {full_y:.4g}, which nobody knows"
    patch = f" (patches of {convention.factor})" if convention.factor else ""
    return f"{convention.order}, {scale}{patch}"


def advice(found: Calibration) -> Sequence[str]:
    """What to do with it, a line each."""
    if found.certainty == "none":
        return (
            f"{found.model} does not give boxes that lie on the shapes ({found.shapes_told} of {found.shapes_shown} "
            "shapes were told). Don't let it play a role that needs boxes (floors, recognition).",
        )
    if not found.config:
        return ("The gateway has no name for this scale; ask for another in its prompt, or don't use its boxes.",)
    if found.agrees:
        return ("The gateway is configured so.",)
    lines = [f"In the gateway's file, under [models.{found.model}]:", *found.config.splitlines()]
    if found.certainty == "unclear":
        lines.insert(0, "Not sure: repeat with --rounds 8 before you rely on it.")
    return lines

"""What a vision model is asked, per role. Raise `VERSION` with every change of wording: the cache's key has it."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import pybase64

from contracts.cameras import Camera
from contracts.vlm_gateway import MarkedPoint
from services.vlm_gateway.backends.base import AskedView, Picture
from services.vlm_gateway.chat.boxes import Size
from services.vlm_gateway.chat.schemas import BoxForm, Form

VERSION = 2

Part = dict[str, Any]
Message = dict[str, Any]

SYSTEM = (
    "You are the eyes of a delivery drone that flies in front of a building. You answer questions about its camera "
    "pictures. Rely only on what the pictures show. Answer with a single JSON object and nothing else."
)
_SIDES = ("front", "front right", "right", "back right", "back", "back left", "left", "front left")
_STEEP_DEG = 45.0


class Asked(NamedTuple):
    """One question, ready to be sent: its content parts and the form of its answer."""

    parts: list[Part]
    form: Form


def floors(picture: Picture, form: Form) -> Asked:
    text = (
        "The picture shows the building in front of the drone. How many floors of this building are visible? A floor "
        "counts when the middle of its row of windows lies inside the picture; a row whose middle is cut off by the "
        "upper or lower edge does not count. Other buildings don't count. You must give a number: where it is hard to "
        f"see, give your best estimate.\nAnswer with JSON only, in this form: {form.example}"
    )
    return Asked([_image(picture), _text(text)], form)


def building(picture: Picture, form: Form, boxes: BoxForm) -> Asked:
    size = Size(picture.width, picture.height)
    text = (
        "Where in the picture is the building straight ahead? Give the box round all of it that is visible, from its "
        f'lowest to its highest point. Write "{boxes.key}" as {boxes.in_words(size)}; null if there is no building '
        f"ahead.\nAnswer with JSON only, in this form: {form.example}"
    )
    return Asked([_image(picture), _text(text)], form)


def find(phrase: str, views: Sequence[AskedView], form: Form, boxes: BoxForm) -> Asked:
    parts: list[Part] = []
    for number, view in enumerate(views, start=1):
        parts += [
            _text(f"View {number}: the camera that looks to the {_side(view.camera)}."),
            _image(view.picture),
        ]
    sizes = {Size(view.picture.width, view.picture.height) for view in views}
    if len(sizes) == 1:
        how = boxes.in_words(next(iter(sizes)))
    else:
        how = "; ".join(
            f"in view {number}: {boxes.in_words(Size(view.picture.width, view.picture.height))}"
            for number, view in enumerate(views, start=1)
        )
    text = (
        f"We look for this object at a window of the building: {_quoted(phrase)}. Is it visible in any view? Both the "
        "kind of thing and its attributes must fit: a thing of the same colour but of another kind is not it. For "
        f'each place where you see it, give the number of the view, "{boxes.key}" as {how}, and your confidence '
        "from 0.0 to 1.0. If you don't see it, say so: that is a good answer.\n"
        f"Answer with JSON only, in this form: {form.example}"
    )
    return Asked([*parts, _text(text)], form)


def direction(picture: Picture, camera: Camera, points: Sequence[MarkedPoint], task: str, form: Form) -> Asked:
    reach = "; ".join(
        f"{point.label} ({round(point.x * 100)} % from the left): {point.distance_m:.1f} m" for point in points
    )
    text = (
        f"The picture comes from the camera that looks to the {_side(camera)}. Points are marked in it with letters. "
        f"The drone searches along the outside of the building and has this task: {_quoted(task)}. It can fly this far "
        f"towards each point without touching anything: {reach}. Which point should it fly to, so that it goes on "
        "round the building and sees parts of the facade that it has not seen, without leaving the building?\n"
        f"Answer with JSON only, in this form: {form.example}"
    )
    return Asked([_image(picture), _text(text)], form)


def in_words(instruction: str, pictures: Sequence[Picture], form: Form) -> Asked:
    """A question that is none of the four."""
    text = f"{instruction}\nAnswer with JSON only, in this form: {form.example}"
    return Asked([*(_image(picture) for picture in pictures), _text(text)], form)


def messages(asked: Asked, *, reads_system: bool) -> list[Message]:
    """The conversation so far; where the template knows no system message its text opens the question."""
    if reads_system:
        return [{"role": "system", "content": SYSTEM}, {"role": "user", "content": asked.parts}]
    return [{"role": "user", "content": [_text(SYSTEM), *asked.parts]}]


def repair(answer: str, problem: str, form: Form) -> list[Message]:
    """What is added to the conversation to ask once more, after an answer that could not be read."""
    text = (
        f"That answer can't be used: {problem}. Give the same answer again as one JSON object in exactly this form, "
        f"without any other text: {form.example}"
    )
    return [{"role": "assistant", "content": answer[:4000] or "(nothing)"}, {"role": "user", "content": text}]


def _side(camera: Camera) -> str:
    """Where a camera looks, in words: the nearest of eight sides, or up or down."""
    if abs(camera.pitch_deg) > _STEEP_DEG:
        return "sky, straight up" if camera.pitch_deg > 0 else "ground, straight down"
    return _SIDES[round(camera.heading_deg / 45.0) % 8]


def _text(text: str) -> Part:
    return {"type": "text", "text": text}


def _image(picture: Picture) -> Part:
    data = pybase64.b64encode(picture.jpeg).decode("ascii")
    return {"type": "image_url", "image_url": {"url": "data:image/jpeg;base64," + data}}


def _quoted(words: str) -> str:
    """A customer's words, kept to one line and inside their quotes, so that they stay words."""
    return '"' + " ".join(words.replace('"', "'").split()) + '"'

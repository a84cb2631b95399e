"""A vision back end that knows colours and nothing else: the largest patch of the colour that the phrase names."""

from typing import TYPE_CHECKING

from pydantic import ValidationError

from contracts.base import Unit, Wire
from contracts.errors import first_problem
from contracts.geometry import Box
from contracts.vlm_gateway import Match
from service_kit.errors import BadQuestion
from service_kit.settings import BadSetting
from services.vlm_gateway.backends.base import (
    Building,
    BuildingAsk,
    Direction,
    DirectionAsk,
    Floors,
    FloorsAsk,
    ObjectAsk,
    Picture,
    Reply,
    Sightings,
)
from services.vlm_gateway.backends.extension import ExtensionModel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

HUES = {"red": 0, "yellow": 30, "green": 60, "blue": 110, "purple": 140}
"""Degrees / 2, as OpenCV counts them."""


class Options(Wire):
    """What `options` in the gateway's configuration may hold. `min_share`: of the picture that a patch must fill."""

    min_share: Unit = 0.0005


def build(model: ExtensionModel) -> "ColourBackend":
    """What the entry point names. Raises BadSetting for options there are not."""
    try:
        return ColourBackend(Options.model_validate(model.options))
    except ValidationError as error:
        raise BadSetting(f"models.{model.alias}.options: {first_problem(error)}") from None


class ColourBackend:
    """Stateless: the same pixels get the same answer."""

    kind = "colour"
    model = "colour-1"
    cacheable = True

    def __init__(self, options: Options) -> None:
        self._options = options

    @property
    def fingerprint(self) -> dict[str, object]:
        return {"version": 1, **self._options.model_dump()}

    async def preflight(self, phrase: str | None) -> str | None:
        return None if phrase is None or _hue(phrase) is not None else f"it knows the colours {', '.join(HUES)} only"

    async def count_floors(self, ask: FloorsAsk) -> Reply[Floors]:
        return Reply("refused", text="colours have no floors")

    async def find_building(self, ask: BuildingAsk) -> Reply[Building]:
        return Reply("answered", Building(None))

    async def find_object(self, ask: ObjectAsk) -> Reply[Sightings]:
        hue = _hue(ask.phrase)
        if hue is None:
            return Reply("refused", text=f"no colour of {', '.join(HUES)} in {ask.phrase!r}")
        found = ((view, self._largest_patch(view.picture, hue)) for view in ask.views)
        # a match belongs to the view that it was found in
        matches = [Match(camera=view.camera.name, box=box, confidence=0.9) for view, box in found if box]
        return Reply("answered", Sightings(tuple(matches)))

    async def choose_direction(self, ask: DirectionAsk) -> Reply[Direction]:
        farthest = max(ask.points, key=lambda point: point.distance_m)
        return Reply("answered", Direction(farthest.label))

    def status(self) -> dict[str, object]:
        return {"colours": list(HUES)}

    async def close(self) -> None:
        return

    def _largest_patch(self, picture: Picture, hue: int) -> Box | None:
        import cv2  # heavy imports belong into what needs them

        hsv = cv2.cvtColor(_pixels(picture), cv2.COLOR_BGR2HSV)
        off = abs(hsv[..., 0].astype(int) - hue)
        strong = (((off < 12) | (off > 168)) & (hsv[..., 1] > 110) & (hsv[..., 2] > 60)).astype("uint8")
        count, _, stats, _ = cv2.connectedComponentsWithStats(strong)
        patches = [stats[n] for n in range(1, count) if stats[n][4] >= self._options.min_share * strong.size]
        if not patches:
            return None
        x, y, w, h, _ = max(patches, key=lambda patch: int(patch[4]))
        width, height = picture.width, picture.height
        return Box(x_min=x / width, y_min=y / height, x_max=(x + w) / width, y_max=(y + h) / height)


def _hue(phrase: str) -> int | None:
    return next((HUES[word] for word in phrase.split() if word in HUES), None)


def _pixels(picture: Picture) -> "NDArray[np.uint8]":
    import cv2
    import numpy as np

    bgr = cv2.imdecode(np.frombuffer(picture.jpeg, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise BadQuestion("the picture's data could not be decoded", code="bad_image")
    return bgr.astype(np.uint8, copy=False)

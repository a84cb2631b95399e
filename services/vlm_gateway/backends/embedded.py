"""The model that ships with the project, behind the port: pixels and text in, decoded and run off the event loop."""

import asyncio
import hashlib
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, partial
from typing import Protocol, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.geometry import PointLabel
from contracts.vlm_gateway import MAX_MATCHES, Match
from service_kit.errors import BadQuestion
from services.vlm_gateway.admission import Admission
from services.vlm_gateway.backends.base import (
    Building,
    BuildingAsk,
    Direction,
    DirectionAsk,
    Floors,
    FloorsAsk,
    Kind,
    ObjectAsk,
    Picture,
    Reply,
    Sightings,
)
from services.vlm_gateway.embedded.seen import BoxSeen, FloorsSeen, Found, MarkedPlace, Shot
from services.vlm_gateway.embedded.words import OutOfVocabulary
from services.vlm_gateway.errors import ModelTimeout

T = TypeVar("T")
TRAINED_PITCH_DEG = 30.0
"""Nothing was learnt of how things look from far below or above: such views are passed over."""


class PixelModel(Protocol):
    """A model in this process, called from several threads at once."""

    @property
    def version(self) -> str: ...

    @property
    def about(self) -> dict[str, object]:
        """What is known of how it was made, for operators and the model card."""

    def out_of_vocabulary(self, phrase: str) -> str | None:
        """Why the phrase names nothing that the model was trained on; None where it names something."""

    def count_floors(self, shot: Shot) -> FloorsSeen: ...

    def building_box(self, shot: Shot) -> BoxSeen | None: ...

    def find_object(self, views: Sequence[Shot], phrase: str) -> Found:
        """Raises OutOfVocabulary."""

    def choose_direction(self, shot: Shot, points: Sequence[MarkedPlace]) -> PointLabel: ...


class JpegShot:
    """A picture as it came, decoded when a model wants its pixels; the file's hash and the focal length are its key."""

    def __init__(self, picture: Picture, camera: Camera | None = None) -> None:
        self._picture = picture
        self._camera = camera

    @cached_property
    def key(self) -> Hashable:
        return hashlib.blake2b(self._picture.jpeg, digest_size=16).digest(), self.focal_px

    @property
    def focal_px(self) -> float | None:
        """In pixels of the picture, which may have another size than the camera's own."""
        camera = self._camera
        return None if camera is None else camera.fx_px * self._picture.width / camera.width

    def rgb(self) -> NDArray[np.uint8]:
        """Raises BadQuestion."""
        return pixels(self._picture)


class EmbeddedBackend:
    """`concurrency` threads; each question is one piece of work. `revision` tells models of the same version apart in
    the cache."""

    kind: Kind = "embedded"
    cacheable = True

    def __init__(
        self, model: PixelModel, *, alias: str, concurrency: int, queue: int, timeout_s: float, revision: str = ""
    ) -> None:
        self._model = model
        self._revision = revision
        self._alias = alias
        self._timeout_s = timeout_s
        self._admission = Admission(alias, concurrency, queue)
        self._threads = ThreadPoolExecutor(concurrency, thread_name_prefix="embedded")

    @property
    def model(self) -> str:
        return f"embedded-{self._model.version}"

    @property
    def fingerprint(self) -> dict[str, object]:
        return {"version": self._model.version, "revision": self._revision}

    async def preflight(self, phrase: str | None) -> str | None:
        return None if phrase is None else self._model.out_of_vocabulary(phrase)

    async def count_floors(self, ask: FloorsAsk) -> Reply[Floors]:
        return await self._run(partial(self._count_floors, ask))

    async def find_building(self, ask: BuildingAsk) -> Reply[Building]:
        return await self._run(partial(self._find_building, ask))

    async def find_object(self, ask: ObjectAsk) -> Reply[Sightings]:
        return await self._run(partial(self._find_object, ask))

    async def choose_direction(self, ask: DirectionAsk) -> Reply[Direction]:
        return await self._run(partial(self._choose_direction, ask))

    def status(self) -> dict[str, object]:
        return {"running": self._admission.running, "waiting": self._admission.waiting, **self._model.about}

    async def close(self) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)

    async def _run(self, work: Callable[[], T]) -> T:
        try:
            async with asyncio.timeout(self._timeout_s), self._admission:
                return await asyncio.get_running_loop().run_in_executor(self._threads, work)
        except TimeoutError:
            message = f"model {self._alias!r} gave no answer within {self._timeout_s:g} s"
            raise ModelTimeout(message, details={"model": self._alias, "timeout_s": self._timeout_s}) from None

    def _count_floors(self, ask: FloorsAsk) -> Reply[Floors]:
        seen = self._model.count_floors(JpegShot(ask.picture, ask.camera))
        return Reply("answered", Floors(seen.count, tuple(seen.rows)))

    def _find_building(self, ask: BuildingAsk) -> Reply[Building]:
        seen = self._model.building_box(JpegShot(ask.picture, ask.camera))
        return Reply("answered", Building(None if seen is None else seen.box))

    def _find_object(self, ask: ObjectAsk) -> Reply[Sightings]:
        views = [view for view in ask.views if abs(view.camera.pitch_deg) <= TRAINED_PITCH_DEG]
        try:
            found = self._model.find_object([JpegShot(view.picture, view.camera) for view in views], ask.phrase)
        except OutOfVocabulary as error:
            return Reply("refused", text=str(error))
        best_first = sorted(found.sightings, key=lambda sighting: -sighting.confidence)[:MAX_MATCHES]
        matches = (
            Match(camera=views[s.view_index].camera.name, box=s.box, confidence=s.confidence) for s in best_first
        )
        return Reply("answered", Sightings(tuple(matches), found.claim))

    def _choose_direction(self, ask: DirectionAsk) -> Reply[Direction]:
        return Reply("answered", Direction(self._model.choose_direction(JpegShot(ask.picture, ask.camera), ask.points)))


def pixels(picture: Picture) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 RGB. Raises BadQuestion where the file does not hold what its header promises."""
    bgr = cv2.imdecode(np.frombuffer(picture.jpeg, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise BadQuestion("the picture's data could not be decoded", code="bad_image")
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)

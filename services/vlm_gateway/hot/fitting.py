"""A chat's pictures made to fit a target, where they don't: off the event loop, and few at a time."""

import asyncio
from collections.abc import Sequence

from services.vlm_gateway.pictures import ChatPicture
from services.vlm_gateway.reencode import scaled_url
from services.vlm_gateway.upstream.accepted import PictureBounds

AT_A_TIME = 2
"""A photograph of 50 megapixels takes 150 MB while it is decoded."""


class PictureFitter:
    """Scales pictures in threads, `AT_A_TIME` of them, whoever asks."""

    def __init__(self) -> None:
        self._free = asyncio.Semaphore(AT_A_TIME)

    async def fitted(self, pictures: Sequence[ChatPicture], bounds: PictureBounds) -> dict[int, str]:
        """The data URLs of those that have to be scaled or converted, by their place in `pictures`. Raises BadQuestion
        (`bad_image`)."""
        scaled: dict[int, str] = {}
        for at, picture in enumerate(pictures):
            if bounds.take(picture):
                continue
            async with self._free:
                scaled[at] = await asyncio.to_thread(scaled_url, picture, bounds)
        return scaled

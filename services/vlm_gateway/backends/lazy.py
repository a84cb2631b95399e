"""A back end that is built when it is first asked: a gateway that only passes chats on never pays for it."""

import asyncio
from collections.abc import Callable

from service_kit.settings import BadSetting
from services.vlm_gateway.backends.base import (
    Backend,
    Building,
    BuildingAsk,
    Direction,
    DirectionAsk,
    Floors,
    FloorsAsk,
    Kind,
    ObjectAsk,
    Reply,
    Sightings,
)
from services.vlm_gateway.errors import ModelUnreachable


class LazyBackend:
    """`build` is called once, in a thread. Until then `model` is only the kind, and the fingerprint is empty: ask
    `ready` for the real one before an answer is kept under it."""

    cacheable = True

    def __init__(self, alias: str, kind: Kind, build: Callable[[], Backend]) -> None:
        self._alias = alias
        self.kind = kind
        self._build = build
        self._building: asyncio.Task[Backend] | None = None
        self._built: Backend | None = None

    async def ready(self) -> Backend:
        """The real one. Raises ModelUnreachable where it can't be built."""
        if self._built is None:
            if self._building is None:
                self._building = asyncio.create_task(asyncio.to_thread(self._build))
            try:
                self._built = await asyncio.shield(self._building)
            except BadSetting as error:
                self._building = None
                raise ModelUnreachable(str(error), details={"model": self._alias, "reason": "not_installed"}) from None
        return self._built

    @property
    def model(self) -> str:
        return self.kind if self._built is None else self._built.model

    @property
    def fingerprint(self) -> dict[str, object]:
        return {} if self._built is None else self._built.fingerprint

    async def preflight(self, phrase: str | None) -> str | None:
        return await (await self.ready()).preflight(phrase)

    async def count_floors(self, ask: FloorsAsk) -> Reply[Floors]:
        return await (await self.ready()).count_floors(ask)

    async def find_building(self, ask: BuildingAsk) -> Reply[Building]:
        return await (await self.ready()).find_building(ask)

    async def find_object(self, ask: ObjectAsk) -> Reply[Sightings]:
        return await (await self.ready()).find_object(ask)

    async def choose_direction(self, ask: DirectionAsk) -> Reply[Direction]:
        return await (await self.ready()).choose_direction(ask)

    def status(self) -> dict[str, object]:
        return {"loaded": False} if self._built is None else {"loaded": True, **self._built.status()}

    async def close(self) -> None:
        if self._building is not None and self._built is None:
            self._building.cancel()
            await asyncio.gather(self._building, return_exceptions=True)
        if self._built is not None:
            await self._built.close()

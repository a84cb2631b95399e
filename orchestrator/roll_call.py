"""The fleet as it stands: every vehicle is asked how it fares, and the queues get as much room as there is."""

import asyncio
from datetime import UTC, datetime

from contracts.fleet import FleetVehicle
from contracts.vehicle import VehicleCapabilities, VehicleState
from orchestrator.engine import Engine
from orchestrator.hangar import Hangar
from orchestrator.store.vehicles import StoredVehicle, VehicleStore

ASK_S = 3.0
"""So long a vehicle has to say how it fares."""


class RollCall:
    """Over the fleet that this process knows."""

    def __init__(self, hangar: Hangar, store: VehicleStore, engine: Engine) -> None:
        self._hangar = hangar
        self._store = store
        self._engine = engine

    async def register(self) -> None:
        """Makes the fleet known: these are its vehicles, and no others."""
        members = self._hangar.members
        for member in members:
            await asyncio.to_thread(self._store.register, member.name, member.kind, member.room)
        await asyncio.to_thread(self._store.forget, [member.name for member in members])

    async def call(self) -> None:
        """Asks all vehicles at once."""
        await asyncio.gather(*(self._ask(member.name) for member in self._hangar.members))
        await self._engine.set_room(await asyncio.to_thread(self._store.room))

    async def list(self) -> tuple[FleetVehicle, ...]:
        """All vehicles, by name."""
        return tuple(_told(stored) for stored in await asyncio.to_thread(self._store.all))

    async def _ask(self, name: str) -> None:
        try:
            told = await asyncio.wait_for(self._hangar.ask(name), ASK_S)
        except TimeoutError:
            await asyncio.to_thread(self._store.mark_lost, name, f"no answer within {ASK_S:g} s")
            return
        if told.problem is not None:
            await asyncio.to_thread(self._store.mark_lost, name, told.problem)
            return
        state, can = told.state, told.capabilities
        texts = (None if state is None else state.model_dump_json(), None if can is None else can.model_dump_json())
        await asyncio.to_thread(self._store.mark_ready, name, *texts)


def _told(stored: StoredVehicle) -> FleetVehicle:
    can, state = stored.capabilities, stored.state
    return FleetVehicle(
        name=stored.name,
        kind=stored.kind,
        room=stored.room,
        state="lost" if stored.problem is not None else "flying" if stored.flying else "ready",
        problem=stored.problem,
        seen=None if stored.seen is None else datetime.fromtimestamp(stored.seen, UTC),
        deliveries=stored.flying,
        vehicle=None if state is None else VehicleState.model_validate_json(state, extra="ignore"),
        capabilities=None if can is None else VehicleCapabilities.model_validate_json(can, extra="ignore"),
    )

"""Streets from above, for people: the scenes of deliveries as plans."""

import asyncio
import hashlib

from contracts.geometry import Point2
from contracts.orchestrator import DeliveryQuestion
from contracts.overview import StreetBuilding, StreetPlan, StreetRoad
from contracts.scene import Scene
from contracts.scene_layout import wall_height_m
from orchestrator import sample_library
from orchestrator.newest import Newest
from orchestrator.store.deliveries import DeliveryStore

MAX_KEPT = 2_000
"""Keys, of which each takes a fifth of a kilobyte; a plan takes eight."""


def street_of(scene: Scene) -> StreetPlan:
    """The plan of a scene; nothing of what stands at its windows."""
    buildings = tuple(
        StreetBuilding(
            footprint=building.footprint,
            height_m=wall_height_m(building),
            floor_height_m=building.floor_height_m,
            target=building.id == scene.target,
        )
        for building in scene.buildings
    )
    roads = tuple(StreetRoad(start=r.start, end=r.end, width_m=r.width_m) for r in scene.ground.roads)
    start = Point2(x=scene.start.position.x, y=scene.start.position.y)
    plan = StreetPlan(key="unnamed", name=scene.name, buildings=buildings, roads=roads, start=start)
    key = hashlib.sha256(plan.model_dump_json().encode()).hexdigest()[:16]
    return plan.model_copy(update={"key": key})


class Streets:
    """The streets of deliveries."""

    def __init__(self, store: DeliveryStore) -> None:
        self._store = store
        self._keys: Newest[str, str | None] = Newest(MAX_KEPT)

    async def of(self, delivery: str) -> StreetPlan | None:
        """Null where the delivery has no scene, or there is no such delivery."""
        plan = await asyncio.to_thread(self._read, delivery)
        self._keys[delivery] = None if plan is None else plan.key
        return plan

    async def key_of(self, delivery: str) -> str | None:
        """Its key: asked again and again while the delivery flies, and read once."""
        if delivery not in self._keys:
            await self.of(delivery)
        return self._keys[delivery]

    def _read(self, delivery: str) -> StreetPlan | None:
        stored = self._store.get(delivery)
        if stored is None or stored.scene is None:
            return None
        try:
            question = DeliveryQuestion.model_validate_json(stored.question)
            scene = question.scene or (sample_library.load(question.sample).scene if question.sample else None)
        except ValueError:  # asked for in the words of an older version
            return None
        return None if scene is None else street_of(scene)

"""Where the middles of a scene's objects are, for the judge."""

from contracts.scene import Scene, SceneObject, WindowPlace
from contracts.scene_layout import window_slot
from episode_kit.judge import Thing
from episode_kit.kinematics import Vector

HALF_A_THING_M = 0.2
"""Of a thing whose size nobody knows: from its foot to its middle, and from the wall."""


def things_of(scene: Scene, measured: dict[str, Vector]) -> dict[str, Thing]:
    """Every object by its id. `measured`: the middles of those that CARLA has put up; of the others the scene says
    where they stand, and not how large they are."""
    found = [measured.get(thing.id) or _stated_middle(scene, thing) for thing in scene.objects]
    return {o.id: Thing(part, middle) for part, (o, middle) in enumerate(zip(scene.objects, found, strict=True), 1)}


def names_of(kind: str, colour: str) -> tuple[str, ...]:
    """What people call an object, by the words of its class alone: CARLA has no catalogue, so no synonyms."""
    name = kind.replace("_", " ")
    return f"{colour} {name}", name


def _stated_middle(scene: Scene, thing: SceneObject) -> Vector:
    place = thing.place
    if not isinstance(place, WindowPlace):
        return place.position.x, place.position.y, place.position.z + HALF_A_THING_M
    building = scene.building(place.building)
    slot = window_slot(building, place.facade, place.floor, place.column)
    out_m, z = HALF_A_THING_M, slot.centre[2]
    if place.on == "sill":
        z = slot.sill_z + HALF_A_THING_M
    elif place.on == "hang":
        z = slot.centre[2] + slot.height_m / 2 - HALF_A_THING_M
    elif place.on == "balcony":
        z = (place.floor - 1) * building.floor_height_m + HALF_A_THING_M
        out_m = slot.balcony.depth_m / 2 if slot.balcony is not None else out_m
    elif place.on == "pane":
        out_m = 0.0
    aside_m = place.offset_m
    x, y = (slot.centre[i] + slot.along[i] * aside_m + slot.normal[i] * out_m for i in (0, 1))
    return x, y, z

"""Where the scene's objects stand, hang or stick, and the shelves and arms that hold them there.

An object's own axes: +x is its front, +z up; its origin is the middle of the underside (standing things), of the back
(things on a wall or pane) or the hook at the top (hanging things).
"""

import numpy as np

from contracts.scene import Building, Scene, SceneObject, WindowPlace
from contracts.scene_layout import WindowSlot, columns_of, window_slot
from services.sim.geometry.facade import floor_z, slot_frame
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.parts import stamped
from services.sim.geometry.solids import box
from services.sim.geometry.tubes import rod

AIR_M = 0.004


def placed(scene: Scene, thing: SceneObject, mesh: Mesh) -> tuple[Mesh, Mesh | None]:
    """The object where it belongs, and what holds it, if the building's own ledge doesn't."""
    if not isinstance(thing.place, WindowPlace):
        p = thing.place.position
        return mesh.transformed(yaw=thing.yaw, scale=thing.scale, move=(p.x, p.y, p.z)), None
    building = scene.building(thing.place.building)
    slot = window_slot(building, thing.place.facade, thing.place.floor, thing.place.column)
    turned = mesh.transformed(yaw=thing.yaw, scale=thing.scale)
    on = thing.place.on
    if on == "sill":
        local, holder = _on_sill(building, thing.place, turned)
    elif on == "balcony":
        local, holder = _on_balcony(slot, building, thing.place, turned), None
    elif on == "wall":
        local, holder = _on_wall(building, thing.place, turned), None
    elif on == "pane":
        local, holder = _in_pane(building, thing.place, mesh, thing), None
    else:
        local, holder = _hung(building, thing.place, turned)
    frame = slot_frame(slot)
    return stamped(local, [frame]), stamped(holder, [frame]) if holder is not None else None


def keeps_sill(scene: Scene, building: Building) -> set[tuple[int, int, int]]:
    """The windows whose sill carries something: they stay windows even where they have a balcony."""
    places = [o.place for o in scene.objects]
    return {
        (p.facade, p.floor, p.column)
        for p in places
        if isinstance(p, WindowPlace) and p.building == building.id and p.on in ("sill", "pane")
    }


def _on_sill(building: Building, place: WindowPlace, mesh: Mesh) -> tuple[Mesh, Mesh | None]:
    """Back against the frame if it fits between the reveals, else before the wall."""
    grid = building.windows
    low, high = mesh.bounds
    width = float(high[1] - low[1])
    fits = abs(place.offset_m) + width / 2 <= grid.width_m / 2 - 0.02
    back = -grid.reveal_m + 0.08 if fits else 0.02
    x = back - float(low[0])
    sill = -grid.height_m / 2
    local = mesh.transformed(move=(x, place.offset_m, sill + AIR_M - float(low[2])))
    front = x + float(high[0])
    if front <= grid.ledge_m + 0.02 and fits:
        return local, None
    reach, half = max(front + 0.03, grid.ledge_m), max(width / 2 + 0.05, 0.2)
    trim = building.style.trim_colour
    shelf = box((reach, 2 * half, 0.05), (reach / 2, place.offset_m, sill - 0.025 + AIR_M / 2), trim)
    arms = [
        rod(
            (reach * 0.85, place.offset_m + s * (half - 0.08), sill - 0.05),
            (0.0, place.offset_m + s * (half - 0.08), sill - 0.05 - reach * 0.55),
            0.018,
            5,
        ).recoloured("#4a4c4e")
        for s in (-1, 1)
    ]
    return local, concatenate([shelf, *arms])


def _on_balcony(slot: WindowSlot, building: Building, place: WindowPlace, mesh: Mesh) -> Mesh:
    low, high = mesh.bounds
    deep = float(high[0] - low[0])
    room = slot.balcony.depth_m if slot.balcony else deep + 0.3
    # near the railing, where it is seen from below, but inside it
    x = max(room - 0.14 - float(high[0]), 0.05 - float(low[0]))
    z = floor_z(building, place.floor) - slot.centre[2]
    return mesh.transformed(move=(x, place.offset_m, z + AIR_M - float(low[2])))


def _on_wall(building: Building, place: WindowPlace, mesh: Mesh) -> Mesh:
    """Beside the window, on the side where the wall is wider."""
    grid = building.windows
    low, high = mesh.bounds
    half = float(high[1] - low[1]) / 2
    side = -1.0 if place.column == columns_of(building, place.facade) - 1 and place.column > 0 else 1.0
    nearest, farthest = grid.width_m / 2 + half + 0.06, grid.pitch_m - grid.width_m / 2 - half - 0.06
    y = side * min(max(grid.pitch_m / 2 - 0.1, nearest), max(farthest, nearest)) + place.offset_m
    return mesh.transformed(move=(0.06 - float(low[0]), y - float(low[1]) - half, 0.0))


def _in_pane(building: Building, place: WindowPlace, mesh: Mesh, thing: SceneObject) -> Mesh:
    """Before the glass and its bars, made smaller where it wouldn't fit."""
    grid = building.windows
    low, high = mesh.bounds
    room = (grid.width_m - 0.12, grid.height_m - 0.12)
    scale = min(thing.scale, room[0] / max(float(high[1] - low[1]), 1e-6), room[1] / max(float(high[2] - low[2]), 1e-6))
    local = mesh.transformed(scale=scale)
    low, high = local.bounds
    y = float(np.clip(place.offset_m, -(room[0] / 2 - float(high[1])), room[0] / 2 - float(high[1])))
    return local.transformed(move=(-grid.reveal_m + 0.075 - float(low[0]), y, -float(low[2] + high[2]) / 2))


def _hung(building: Building, place: WindowPlace, mesh: Mesh) -> tuple[Mesh, Mesh]:
    """From an arm over the window, clear of the wall."""
    grid = building.windows
    low, _ = mesh.bounds
    x = max(0.24, 0.06 - float(low[0]))
    z = grid.height_m / 2 + 0.06
    local = mesh.transformed(move=(x, place.offset_m, z - 0.03))
    arm = [
        rod((0.0, place.offset_m, z), (x + 0.06, place.offset_m, z), 0.018, 5),
        rod((0.0, place.offset_m, z + 0.22), (x * 0.8, place.offset_m, z), 0.012, 5),
    ]
    return local, concatenate(arm).recoloured("#4a4c4e")

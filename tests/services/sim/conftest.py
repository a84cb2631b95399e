"""A street of plain boxes: what the simulator's own tests fly in, built in milliseconds; and simulators over HTTP."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from contracts.geometry import Point2, Point3
from contracts.scene import BalconyPlan, Building, FreePlace, Ground, Scene, SceneObject, Start, WindowPlace
from contracts.scene_layout import wall_height_m, window_slot
from episode_kit.limits import Limits
from services.sim.app import build_app
from services.sim.episodes import Episodes
from services.sim.geometry import solids
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.scene_mesh import Chunk, Part, PartKind, SceneMesh, Solid, UnknownObject
from services.sim.geometry.textures import base_textures
from services.sim.render.choice import choose_renderer
from services.sim.render.thread import RenderThread
from tests.services.sim.running_sim import CATALOGUE, Builder, Simulator

CUBE_M = 0.5
ROOMY = Limits()
KINDS = {"flower_pot": ("green", "red")}


def build_boxes(scene: Scene) -> SceneMesh:
    """Buildings as prisms, objects as cubes of half a metre, a flat ground; balconies are left out."""
    meshes: list[Mesh] = []
    parts: list[Part] = []
    bumps: list[Solid] = []

    def add(kind: PartKind, name: str, mesh: Mesh, solid: bool) -> None:
        part = Part(len(parts) + 1, kind, name)
        parts.append(part)
        meshes.append(mesh)
        faces = mesh.faces if solid else mesh.faces[:0]  # a part may have nothing that one can bump into
        bumps.append(Solid(part.id, name, mesh.positions[: mesh.vertex_count if solid else 0], faces.astype(np.int32)))

    half = scene.ground.half_size_m
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    add("surroundings", "ground", solids.polygon(corners, colour="#6a8a4a"), False)
    for building in scene.buildings:
        outline = [(p.x, p.y) for p in building.footprint]
        add("building", building.id, solids.prism(outline, 0.0, wall_height_m(building), "#b08060"), True)
    for o in scene.objects:
        if o.kind not in KINDS or o.colour not in KINDS[o.kind]:
            raise UnknownObject(f"there is no {o.colour} {o.kind}; there are {KINDS}")
        if isinstance(o.place, FreePlace):
            foot = (o.place.position.x, o.place.position.y, o.place.position.z)
        else:
            slot = window_slot(scene.building(o.place.building), o.place.facade, o.place.floor, o.place.column)
            out = CUBE_M / 2 + 0.05
            foot = (slot.centre[0] + slot.normal[0] * out, slot.centre[1] + slot.normal[1] * out, slot.sill_z)
        add("object", o.id, solids.standing_box((CUBE_M,) * 3, foot, "#20a040"), True)
    sizes = [m.triangle_count for m in meshes]
    starts = np.cumsum([0, *sizes[:-1]])
    chunks = [
        Chunk(int(first), count, *(tuple(float(c) for c in corner) for corner in mesh.bounds))
        for first, count, mesh in zip(starts, sizes, meshes, strict=True)
    ]
    part_of = np.concatenate([np.full(m.vertex_count, p.id, np.uint16) for m, p in zip(meshes, parts, strict=True)])
    return SceneMesh(
        concatenate(meshes),
        part_of,
        tuple(parts),
        tuple(chunks),
        tuple(bumps),
        base_textures(),
        scene.light,
        (0.0, 0.0, 0.0),
    )


def square(x: float, y: float, half: float) -> tuple[Point2, ...]:
    return tuple(Point2(x=x + sx * half, y=y + sy * half) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1)))


def make_yard(**changes: object) -> Scene:
    """A house 10 m square about the origin with windows every 3 m on 4 floors of 3 m; its facade 0 looks south,
    where the drone starts 10 m off. A green pot stands at floor 3, column 1; a neighbour lies to the north-east."""
    scene = Scene(
        name="yard",
        buildings=(
            Building(
                id="house",
                kind="low_rise",
                footprint=square(0, 0, 5),
                floors=4,
                balconies=(BalconyPlan(facades=(2,), columns=(0,)),),
            ),
            Building(id="shed", kind="villa", footprint=square(20, 20, 4), floors=2),
        ),
        target="house",
        objects=(
            SceneObject(
                id="pot",
                kind="flower_pot",
                colour="green",
                place=WindowPlace(building="house", facade=0, floor=3, column=1),
            ),
            SceneObject(
                id="far-pot",
                kind="flower_pot",
                colour="red",
                place=WindowPlace(building="house", facade=2, floor=2, column=1),
            ),
        ),
        goal="pot",
        ground=Ground(half_size_m=60.0),
        start=Start(position=Point3(x=0.0, y=-15.0, z=1.5), yaw=float(np.pi / 2)),
    )
    return scene.model_copy(update=changes)


@pytest.fixture(scope="session")
def yard() -> Scene:
    return make_yard()


@pytest.fixture(scope="session")
def yard_with() -> Callable[..., Scene]:
    """The yard with fields of the document changed."""
    return make_yard


@pytest.fixture(scope="session")
def box_builder() -> Callable[[Scene], SceneMesh]:
    return build_boxes


@pytest.fixture(scope="module")
def launch(serve: Callable[[Any], str], box_builder: Builder) -> Iterator[Callable[..., Simulator]]:
    started: list[Simulator] = []

    def go(
        limits: Limits = ROOMY,
        *,
        truth: bool = True,
        renderer: str = "auto",
        builder: Builder = box_builder,
        thread: RenderThread | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> Simulator:
        thread = thread or RenderThread(lambda: choose_renderer(renderer))  # type: ignore[arg-type]
        episodes = Episodes(builder, thread, limits, clock, truth)
        started.append(Simulator(serve(build_app(episodes, thread, CATALOGUE, truth=truth)), episodes))
        return started[-1]

    yield go
    for simulator in started:
        simulator.http.close()


@pytest.fixture(scope="module")
def sim(launch: Callable[..., Simulator]) -> Simulator:
    return launch(Limits(max_episodes=100))

"""A simulator of one episode for the oracle's tests: the truth about a goal at a known place, over real HTTP."""

import math

from fastapi import FastAPI

from contracts.geometry import Box, Point3, Pose
from contracts.sim import Truth, TruthQuestion, TruthView, VisibleObject
from contracts.vehicle import VehicleState
from service_kit.app import create_app
from service_kit.errors import NotFound
from tests.cameras import NAMES

BOX = Box(x_min=0.4, y_min=0.4, x_max=0.5, y_max=0.6)


class SmallSim:
    """Episode `e1`: the drone at the origin faces north; the goal is at `goal`. What the views show is in `objects`
    (by the camera's name), how many floors in `floors`. `blocked` leaves no way to the goal."""

    def __init__(self) -> None:
        self.goal = Point3(x=10, y=0, z=5)
        self.pose = Pose(x=0, y=0, z=5, yaw=math.pi / 2)
        self.objects: dict[str, list[VisibleObject]] = {}
        self.floors = (3, (1.02, 0.5, 0.2))  # by floor, so from the lowest up, as the simulator gives them
        self.building: Box | None = BOX
        self.blocked = False
        self.candidates: tuple[Point3, ...] = ()
        self.app = self._build()

    def shows(
        self, heading: int, *, goal: bool = True, share: float = 0.9, pixels: int = 500, distance_m: float = 9.0
    ) -> None:
        thing = VisibleObject(
            id="pot",
            kind="flower_pot",
            colour="green",
            goal=goal,
            box=BOX,
            pixels=pixels,
            share=share,
            distance_m=distance_m,
        )
        self.objects.setdefault(NAMES[heading], []).append(thing)

    def _build(self) -> FastAPI:
        app = create_app("sim", max_body_bytes=100_000)

        @app.get("/v1/episodes/{name}")
        async def episode(name: str) -> VehicleState:
            self._known(name)
            return VehicleState(
                id=name,
                mode="holding",
                pose=self.pose,
                moves=0,
                path_m=0,
                path_horizontal_m=0,
                flight_s=0,
                collided=False,
            )

        @app.post("/v1/episodes/{name}/truth")
        async def truth(name: str, question: TruthQuestion) -> Truth:
            self._known(name)
            self.candidates = question.candidates
            views = tuple(
                TruthView(
                    camera=camera.name,
                    objects=tuple(self.objects.get(camera.name, ())),
                    building_box=self.building,
                    floors_visible=self.floors[0],
                    floor_rows=self.floors[1],
                )
                for camera in question.cameras
            )
            ways = tuple(
                None if self.blocked else math.dist((p.x, p.y, p.z), (self.goal.x, self.goal.y, self.goal.z))
                for p in question.candidates
            )
            return Truth(pose=self.pose, views=views, remaining_m=ways)

        return app

    def _known(self, name: str) -> None:
        if name != "e1":
            raise NotFound(f"no episode {name!r}")

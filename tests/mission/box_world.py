"""A small honest world for mission tests: one block on flat ground, depth by ray casting, a drone that collides.

`BlockWorld` is a World, `BlockVision` a Vision that answers from the block's geometry, `SceneParser` a Parser that
knows one pattern, and `LocalDepthAssist` a DepthAssist that calls the real service's functions in process.
"""

import asyncio
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from contracts.cameras import Camera, default_rig
from contracts.depth_assist import (
    ApproachAnswer,
    ApproachQuestion,
    ExploreAnswer,
    ExploreQuestion,
    SafeDistancesAnswer,
    SafeDistancesQuestion,
    ViewpointAnswer,
    ViewpointQuestion,
)
from contracts.geometry import Box, Pose
from contracts.images import encode_depth, encode_jpeg
from contracts.llm_parser import ParseAnswer, ParseQuestion
from contracts.scene import Scene
from contracts.sim import Claim, Episode, EpisodeQuestion, Flight, Verdict
from contracts.vehicle import Move, MoveResult, Observation, SensedView, VehicleState
from contracts.vlm_gateway import (
    Answer,
    BuildingBoxAnswer,
    BuildingBoxQuestion,
    ChooseDirectionAnswer,
    ChooseDirectionQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    FloorCountAnswer,
    FloorCountQuestion,
    Match,
    PreflightAnswer,
    PreflightQuestion,
)
from mission.episodes import EpisodeTrial
from mission.placement import InTrial
from mission.ports import Ports, ServiceRefused
from services.depth_assist.app import choose_viewpoint, explore_step, measure_safe_distances, plan_approach
from tests.mission.block import RADIUS_M, SIZE, Block, axes
from tests.mission.block import block_scene as block_scene

RIG = default_rig().scaled_to(SIZE)


@dataclass
class BlockWorld:
    """The block with one drone. `slow_s` is slept at every observation."""

    block: Block = field(default_factory=Block)
    slow_s: float = 0.0
    live: dict[str, VehicleState] = field(default_factory=dict)
    ended: list[str] = field(default_factory=list)
    observations: int = 0

    async def start(self, question: EpisodeQuestion) -> Episode:
        if any(o.kind == "unicorn" for o in question.scene.objects):
            raise ServiceRefused("sim: there is no class unicorn", code="unknown_class", status=422)
        drone = VehicleState(
            id=f"e{len(self.live) + len(self.ended) + 1}",
            mode="holding",
            pose=self.block.start,
            moves=0,
            path_m=0.0,
            path_horizontal_m=0.0,
            flight_s=0.0,
            collided=False,
        )
        self.live[drone.id] = drone
        return Episode(
            id=drone.id,
            status="flying",
            scene=question.scene.name,
            renderer="tiny",
            renderer_detail="ray casting",
            flight=question.flight,
            rig=question.rig.name,
            expires_in_s=600.0,
            vehicle=drone,
        )

    async def observe(self, episode: str, cameras: Sequence[str]) -> Observation:
        await asyncio.sleep(self.slow_s)
        self.observations += 1
        pose = self._episode(episode).pose
        return Observation(
            vehicle=episode,
            number=self.observations,
            pose=pose,
            views=tuple(
                SensedView(
                    camera=c,
                    image=encode_jpeg(np.full((c.height, c.width, 3), 128, np.uint8)),
                    depth=encode_depth(self.block.depth_m(pose, c)),
                )
                for c in (RIG.camera(name) for name in cameras)
            ),
        )

    async def move(self, episode: str, number: int, move: Move) -> MoveResult:
        before = self._episode(episode)
        at = (before.pose.x, before.pose.y, before.pose.z)
        yaw, flown, level, hit = before.pose.yaw, 0.0, 0.0, None
        for goal in move.path:
            end = (goal.x, goal.y, goal.z)
            steps = max(1, math.ceil(math.dist(at, end) / 0.1))
            begin = at
            for k in range(1, steps + 1):
                p = tuple(a + (b - a) * k / steps for a, b in zip(begin, end, strict=True))
                if self.block.distance(*p) < RADIUS_M:
                    hit = "house"
                    break
                flown += math.dist(at, p)
                level += math.dist(at[:2], p[:2])
                at = p
            if math.dist(begin[:2], at[:2]) > 0.01:
                yaw = math.atan2(at[1] - begin[1], at[0] - begin[0])
            if hit:
                break
        pose = Pose(x=at[0], y=at[1], z=at[2], yaw=yaw if move.yaw is None else math.remainder(move.yaw, math.tau))
        after = before.model_copy(
            update={
                "pose": pose,
                "moves": number,
                "path_m": before.path_m + flown,
                "path_horizontal_m": before.path_horizontal_m + level,
                "flight_s": before.flight_s + flown / 4,
                "collided": before.collided or hit is not None,
            }
        )
        self.live[episode] = after
        return MoveResult(
            number=number,
            pose=pose,
            reached=hit is None,
            collided=hit is not None,
            hit=hit,
            path_m=flown,
            flight_s=flown / 4,
            vehicle=after,
        )

    async def claim(self, episode: str, claim: Claim) -> Verdict:
        now = self._episode(episode)
        thing, normal = self.block.thing, self.block.thing_normal
        right = claim.target is not None and math.dist((claim.target.x, claim.target.y, claim.target.z), thing) < 1.0
        away = math.dist((now.pose.x, now.pose.y, now.pose.z), thing)
        front = (now.pose.x - thing[0]) * normal[0] + (now.pose.y - thing[1]) * normal[1] > 0
        return Verdict(
            judged=True,
            delivered=right and away <= 3.0 and front and not now.collided,
            right_window=right,
            distance_m=away,
            in_front=front,
            line_of_sight=True,
            collided=now.collided,
        )

    async def end(self, episode: str) -> None:
        if self.live.pop(episode, None) is not None:
            self.ended.append(episode)

    def pose(self, episode: str) -> Pose:
        return self._episode(episode).pose

    def sees(self, pose: Pose, camera: Camera, thing: tuple[float, float, float] | None = None) -> Box | None:
        """The box (0.8 m each way) of a thing, the block's unless told, in a level view; null where it is out of the
        picture or behind a block."""
        forward, right = axes(pose, camera.heading_deg)
        gap = np.subtract(thing or self.block.thing, (pose.x, pose.y, pose.z))
        ahead, aside = float(gap @ forward), float(gap @ right)
        if ahead < 0.3 or math.hypot(*gap) > 16.0:
            return None
        x = (camera.cx_px + camera.fx_px * aside / ahead) / camera.width
        y = (camera.cy_px - camera.fy_px * float(gap[2]) / ahead) / camera.height
        half = 0.4 / ahead * camera.fx_px / camera.width
        hidden = float(self.block.cast((pose.x, pose.y, pose.z), gap[None])[0]) < 0.999
        if hidden or not (half < x < 1 - half and half < y < 1 - half):
            return None
        return Box(x_min=x - half, y_min=y - half, x_max=x + half, y_max=y + half)

    def _episode(self, episode: str) -> VehicleState:
        if episode not in self.live:
            raise ServiceRefused(f"sim: there is no episode {episode}", code="not_found", status=404)
        return self.live[episode]


@dataclass
class BlockVision:
    """Answers from geometry. `says` overrides single answers by method name, in order; null passes one through; an
    exception is raised. `unknown` are things that it has never learnt to see."""

    world: BlockWorld
    says: dict[str, list[Answer | Exception | None]] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)
    unknown: frozenset[str] = frozenset()

    async def preflight(self, question: PreflightQuestion) -> PreflightAnswer:
        known = None if question.object is None else question.object not in self.unknown
        why = f"{question.object} is not among the things it has learnt" if known is False else None
        return self._said("preflight", PreflightAnswer(model="geometry", backend="scripted", known=known, why=why))

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
        pose, block = self._pose("floor_count", question.oracle_episode), self.world.block
        reach = pose.y * -1 + block.y0 if abs(pose.x) < block.x1 else 1.0
        middles = [(k + 0.5) * block.floor_height_m for k in range(block.floors)]
        seen = [m for m in middles if abs(m - pose.z) < abs(reach)]
        return self._said("floor_count", FloorCountAnswer(role="floors", floors=len(seen), **WHO))

    async def building_box(self, question: BuildingBoxQuestion) -> BuildingBoxAnswer:
        self._pose("building_box", question.oracle_episode)
        box = Box(x_min=0.0, y_min=0.3, x_max=1.0, y_max=0.7)
        return self._said("building_box", BuildingBoxAnswer(role="floors", box=box, **WHO))

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer:
        pose = self._pose("find_object", question.oracle_episode)
        boxes = {v.camera.name: self.world.sees(pose, v.camera) for v in question.views}
        matches = tuple(Match(camera=name, box=b, confidence=0.9) for name, b in boxes.items() if b)
        return self._said(
            "find_object", FindObjectAnswer(role="recognition", found=bool(matches), matches=matches, **WHO)
        )

    async def choose_direction(self, question: ChooseDirectionQuestion) -> ChooseDirectionAnswer:
        self._pose("choose_direction", question.oracle_episode)
        label = next((p.label for p in question.points if p.label == "c"), question.points[0].label)
        return self._said("choose_direction", ChooseDirectionAnswer(role="choice", label=label, **WHO))

    def _pose(self, method: str, episode: str | None) -> Pose:
        self.asked.append(method)
        return self.world.pose(episode or "")

    def _said(self, method, usual):
        planned = self.says.get(method)
        said = planned.pop(0) if planned else None
        if isinstance(said, Exception):
            raise said
        return usual if said is None else said


WHO = {"outcome": "answered", "backend": "scripted", "model": "geometry"}


class LocalDepthAssist:
    """The depth_assist service's own functions, without the wire."""

    async def viewpoint(self, question: ViewpointQuestion) -> ViewpointAnswer:
        return choose_viewpoint(question)

    async def safe_distances(self, question: SafeDistancesQuestion) -> SafeDistancesAnswer:
        return measure_safe_distances(question)

    async def approach(self, question: ApproachQuestion) -> ApproachAnswer:
        return plan_approach(question)

    async def explore(self, question: ExploreQuestion) -> ExploreAnswer:
        return explore_step(question)


class SceneParser:
    """Reads "... floor <number>, ... the <object>"."""

    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        floor = re.search(r"floor (\d+)", question.request)
        thing = re.search(r"the (\w+ \w+ \w+)$", question.request)
        found = {"floor": int(floor[1]) if floor else None, "object": thing[1] if thing else None}
        return ParseAnswer(**found, missing=tuple(k for k, v in found.items() if v is None), model="pattern")


def block_ports(world: BlockWorld, vision: BlockVision | None = None, depth: LocalDepthAssist | None = None) -> Ports:
    return Ports(SceneParser(), vision or BlockVision(world), depth or LocalDepthAssist())


def block_trial(world: BlockWorld) -> EpisodeTrial:
    return EpisodeTrial(world)


def block_placement(world: BlockWorld, scene: Scene | None = None) -> InTrial:
    """The block world's drone at its start, and its judge."""
    return InTrial(block_trial(world), scene or block_scene(world.block), Flight(), RIG)

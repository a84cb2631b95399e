"""The services of mission tests, in process, around the block world.

`BlockVision` is a Vision that answers from the block's geometry, `SceneParser` a Parser that knows one pattern, and
`LocalDepthAssist` a DepthAssist that calls the real service's functions.
"""

import re
from dataclasses import dataclass, field

from contracts.cameras import Rig, default_rig
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
from contracts.llm_parser import ParseAnswer, ParseQuestion
from contracts.scene import Scene
from contracts.sim import EpisodeQuestion
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
from mission.placement import InTrial
from mission.ports import Parser, Ports
from services.depth_assist.app import choose_viewpoint, explore_step, measure_safe_distances, plan_approach
from tests.mission.block import SIZE, block_scene
from tests.mission.block_vehicle import BlockWorld

RIG = default_rig().scaled_to(SIZE)


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
        pose, block = self._pose("floor_count"), self.world.block
        reach = pose.y * -1 + block.y0 if abs(pose.x) < block.x1 else 1.0
        middles = [(k + 0.5) * block.floor_height_m for k in range(block.floors)]
        seen = [m for m in middles if abs(m - pose.z) < abs(reach)]
        return self._said("floor_count", FloorCountAnswer(role="floors", floors=len(seen), **WHO))

    async def building_box(self, question: BuildingBoxQuestion) -> BuildingBoxAnswer:
        self._pose("building_box")
        box = Box(x_min=0.0, y_min=0.3, x_max=1.0, y_max=0.7)
        return self._said("building_box", BuildingBoxAnswer(role="floors", box=box, **WHO))

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer:
        pose = self._pose("find_object")
        boxes = {v.camera.name: self.world.block.sees(pose, v.camera) for v in question.views}
        matches = tuple(Match(camera=name, box=b, confidence=0.9) for name, b in boxes.items() if b)
        return self._said(
            "find_object", FindObjectAnswer(role="recognition", found=bool(matches), matches=matches, **WHO)
        )

    async def choose_direction(self, question: ChooseDirectionQuestion) -> ChooseDirectionAnswer:
        self._pose("choose_direction")
        label = next((p.label for p in question.points if p.label == "c"), question.points[0].label)
        return self._said("choose_direction", ChooseDirectionAnswer(role="choice", label=label, **WHO))

    def _pose(self, method: str) -> Pose:
        self.asked.append(method)
        return self.world.pose

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
    """Reads "... floor <number>, ... the <object>", first of what was answered last."""

    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        said = [exchange.answer for exchange in reversed(question.exchanges)] + [question.request]
        floor = next((found for text in said if (found := re.search(r"floor (\d+)", text))), None)
        thing = next((found for text in said if (found := re.search(r"the (\w+ \w+ \w+)$", text))), None)
        found = {"floor": int(floor[1]) if floor else None, "object": thing[1] if thing else None}
        return ParseAnswer(**found, missing=tuple(k for k, v in found.items() if v is None), model="pattern")


def block_ports(
    world: BlockWorld,
    vision: BlockVision | None = None,
    depth: LocalDepthAssist | None = None,
    parser: Parser | None = None,
) -> Ports:
    return Ports(parser or SceneParser(), vision or BlockVision(world), depth or LocalDepthAssist())


def block_placement(world: BlockWorld, scene: Scene | None = None, rig: Rig = RIG) -> InTrial:
    """The block world's drone at its start, and its judge."""
    return InTrial(world, EpisodeQuestion(scene=scene or block_scene(world.block), rig=rig))

"""The contour explorer over the wire: the map as text, the question in, the answer out."""

import numpy as np
import pybase64
import zstandard

from contracts.cameras import Camera as RigCamera
from contracts.depth_assist import ExploreAnswer, ExploreDrawing, ExploreQuestion, PlanPoint
from contracts.geometry import Box, Point2
from contracts.images import BadImage, decode_base64
from navigation.camera import DepthView, Pose, bearing_deg
from navigation.explorer import map_codec
from navigation.explorer.explore import Memory, NoFacade, Step, explore
from navigation.explorer.map import CELL_M, SIZE, Bools, Map, middles_of
from navigation.explorer.parameters import ExplorerParameters
from navigation.keep_out import volumes
from service_kit.errors import BadQuestion
from services.depth_assist.views import camera_of

AHEAD_DEG = 25.0
_EDGE_DEG = 1.0
"""A building cut off by both edges of the picture says nothing of where it is."""
_BORDER_M = 5.0
_MAX_DRAWN = 2000


def next_step(question: ExploreQuestion, views: list[DepthView], front: RigCamera) -> ExploreAnswer:
    """`front` took the building's box. Raises BadQuestion: bad_map, outside_map, no_facade."""
    memory = None if question.map is None else unpack(question.map)
    pose = Pose(question.pose.x, question.pose.y, question.pose.z, question.pose.yaw)
    if memory is not None and not _inside(memory.map, pose):
        raise BadQuestion(
            f"the drone at ({pose.x:.0f}, {pose.y:.0f}) has left the map, which spans {SIZE * CELL_M:g} m; "
            "leave the map out to begin a new search",
            code="outside_map",
        )
    settings = ExplorerParameters(**question.settings.model_dump())
    try:
        box_deg = _bearings(question.building_box, front)
        step = explore(memory, views, pose, settings, box_deg, volumes(question.keep_out))
    except NoFacade as error:
        raise BadQuestion(str(error), code="no_facade") from None
    return _answer(step)


def pack(memory: Memory) -> str:
    """The memory as text: zstd, base64; a few KB."""
    return pybase64.b64encode(zstandard.ZstdCompressor(level=3).compress(map_codec.to_bytes(memory))).decode("ascii")


def unpack(text: str) -> Memory:
    """Raises BadQuestion (bad_map); nothing is unpacked that does not say beforehand that it has a map's length."""
    try:
        packed = decode_base64(text, "map")
        stated = zstandard.frame_content_size(packed)
        if stated != map_codec.LENGTH:
            raise BadQuestion(f"the map unpacks to {stated} bytes; it needs {map_codec.LENGTH}", code="bad_map")
        data = zstandard.ZstdDecompressor().decompress(packed, max_output_size=map_codec.LENGTH)
        return map_codec.from_bytes(data)
    except zstandard.ZstdError as error:
        raise BadQuestion(f"the map is not a zstd frame: {error}", code="bad_map") from None
    except (BadImage, map_codec.BadMemory) as error:
        raise BadQuestion(str(error), code="bad_map") from None


def _answer(step: Step) -> ExploreAnswer:
    decision, grid = step.decision, step.memory.map
    return ExploreAnswer(
        status=decision.status,
        reason=decision.reason,
        stop=Point2(x=decision.place[0], y=decision.place[1]) if decision.status == "move" else None,
        bearing_deg=decision.bearing_deg,
        distance_m=decision.distance_m,
        yaw=decision.yaw,
        gain_m=decision.gain_m,
        way_m=decision.way_m,
        inspected_share=step.inspected_share,
        step=step.memory.steps,
        map=pack(step.memory),
        drawing=ExploreDrawing(
            cell_m=CELL_M,
            inspected=_points(grid, step.seen),
            uninspected=_points(grid, step.target & ~step.seen),
            expected=_points(grid, grid.expected),
            way=tuple((round(x, 2), round(y, 2)) for x, y in decision.way),
        ),
    )


def _points(grid: Map, mask: Bools) -> tuple[PlanPoint, ...]:
    cells = np.flatnonzero(mask.reshape(-1))
    places = middles_of(grid, cells[:: max(1, -(-len(cells) // _MAX_DRAWN))])
    return tuple((round(float(x), 2), round(float(y), 2)) for x, y in places)


def _bearings(box: Box | None, front: RigCamera) -> tuple[float, float]:
    """Between which bearings the target building lies ahead; a box says it better where it is narrow."""
    if box is None:
        return -AHEAD_DEG, AHEAD_DEG
    camera = camera_of(front)
    left, right = (camera.heading_deg + bearing_deg(camera, x * camera.width) for x in (box.x_min, box.x_max))
    whole = left <= camera.left_deg + _EDGE_DEG and right >= camera.right_deg - _EDGE_DEG
    middle = 0.0 if whole else min(max((left + right) / 2, -AHEAD_DEG), AHEAD_DEG)
    return max(left, middle - AHEAD_DEG), min(right, middle + AHEAD_DEG)


def _inside(grid: Map, pose: Pose) -> bool:
    span = SIZE * CELL_M
    return all(_BORDER_M <= at <= span - _BORDER_M for at in (pose.x - grid.west_m, pose.y - grid.south_m))

"""Tasks and episodes by hand, for the tests of figures and report."""

from collections.abc import Sequence
from pathlib import Path

from contracts.geometry import Point2, Point3, Pose
from contracts.orchestrator import DeliveryResult, MissionSettings, ModelCalls, OutcomeName, Stop
from contracts.scene import Building, Scene, SceneObject, Start, WindowPlace
from contracts.scene_layout import window_slot
from contracts.sim import Verdict
from evaluation.bench.folder import RunFolder
from evaluation.bench.run_settings import RunSettings
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.taxonomy import reason_of
from evaluation.task_set.task import Task
from evaluation.task_set.task_files import lines_of, read

FLOOR = 3


def rectangle(name: str, x: float, y: float, width: float = 20.0, depth: float = 12.0, floors: int = 5) -> Building:
    """A block whose footprint's south-west corner lies at (x, y)."""
    corners = ((x, y), (x + width, y), (x + width, y + depth), (x, y + depth))
    return Building(
        id=name, kind="low_rise", footprint=tuple(Point2(x=a, y=b) for a, b in corners), floors=floors, floor_height_m=3
    )


def a_task(name: str = "t-1", *, floor: int = FLOOR, facade: int = 0, **more: object) -> Task:
    """The goal's window is the middle one of a facade of a 20 x 12 m block; a neighbour stands 40 m to the east."""
    home, neighbour = rectangle("home", 0.0, 0.0), rectangle("neighbour", 60.0, 0.0)
    column = 3 if facade % 2 == 0 else 1
    slot = window_slot(home, facade, floor, column)
    scene = Scene(
        name=name,
        buildings=(home, neighbour),
        target="home",
        objects=(
            SceneObject(
                id="goal",
                kind="flower_pot",
                colour="green",
                place=WindowPlace(building="home", facade=facade, floor=floor, column=column),
            ),
        ),
        goal="goal",
        start=Start(position=Point3(x=10.0, y=-9.0, z=1.5), yaw=1.5708),
    )
    fields: dict[str, object] = {
        "id": name,
        "seed": 1,
        "request": "Bring it to the third floor, the window with the green flower pot",
        "template": "t001",
        "style": "plain",
        "scene": scene,
        "building": "home",
        "building_kind": "low_rise",
        "footprint": "rectangle",
        "floors": 5,
        "floor": floor,
        "object": "green flower pot",
        "object_kind": "flower_pot",
        "object_colour": "green",
        "category": "containers",
        "target": Point3(x=slot.centre[0], y=slot.centre[1], z=slot.centre[2]),
        "target_height_m": slot.centre[2],
        "floor_height_m": 3.0,
        "corners": 0,
        "difficulty": "easy",
        "shortest_horizontal_m": 10.0,
        "shortest_spatial_m": 12.0,
    }
    return Task.model_validate(fields | more)


def a_verdict(
    *,
    right: bool = True,
    distance_m: float = 2.0,
    in_front: bool = True,
    sight: bool = True,
    collided: bool = False,
) -> Verdict:
    return Verdict(
        judged=True,
        delivered=right and distance_m <= 3 and in_front and sight and not collided,
        right_window=right,
        distance_m=distance_m,
        in_front=in_front,
        line_of_sight=sight,
        collided=collided,
    )


def a_result(outcome: OutcomeName = "delivered", verdict: Verdict | None = None, **more: object) -> DeliveryResult:
    fields: dict[str, object] = {
        "outcome": outcome,
        "message": "as told",
        "steps": 4,
        "exploration_steps": 2,
        "path_m": 24.0,
        "path_horizontal_m": 20.0,
        "flight_s": 12.0,
        "floor": FLOOR,
        "object": "green flower pot",
        "final_height_m": 7.5,
        "pose": Pose(x=10.0, y=-2.0, z=7.5, yaw=1.57),
        "verdict": verdict,
        "timings_s": {"total": 2.0},
        "model_calls": {
            "recognition": ModelCalls(calls=3, cache_hits=1, prompt_tokens=30, seconds=0.6, latencies_s=(0.2, 0.4))
        },
        "renderer": "tiny",
    }
    return DeliveryResult.model_validate(fields | more)


def delivered(**more: object) -> DeliveryResult:
    return a_result("delivered", a_verdict(), **more)


def stops(*places: tuple[float, float, float]) -> tuple[Stop, ...]:
    """Exploration stops at floor height, (x, y, yaw)."""
    return tuple(Stop(phase="explore", pose=Pose(x=x, y=y, z=7.5, yaw=yaw)) for x, y, yaw in places)


def a_record(task: Task, result: DeliveryResult | None, error: str | None = None, **more: object) -> EpisodeRecord:
    fields: dict[str, object] = {
        "task": task.id,
        "reason": reason_of(task, result),
        "result": result,
        "error": error,
        "started": "2026-01-01T00:00:00Z",
        "wall_s": 3.0,
        "render_s": 1.0,
        "model_s": 0.5,
    }
    return EpisodeRecord.model_validate(fields | more)


def run_settings(tasks: Sequence[Task], **mission: object) -> RunSettings:
    """The paper's rule, unless `mission` says otherwise."""
    return RunSettings(
        tasks="by hand",
        checksum=read(lines_of(tasks), "by hand").checksum,
        count=len(tasks),
        backend="embedded",
        mission=MissionSettings.model_validate({"viewpoint": {"policy": "paper"}} | mission),
        workers=1,
        versions={"logisticsvln": "0.1.0"},
    )


def a_run(path: Path, tasks: Sequence[Task], records: Sequence[EpisodeRecord], **mission: object) -> Path:
    """A run's folder with these results, 12 s after its start."""
    with RunFolder(path, run_settings(tasks, **mission), tasks) as folder:
        for record in records:
            folder.add(record, 12.0)
    return path

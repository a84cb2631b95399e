"""What is really in recorded pictures: the scene built again, the drone flown to where they were taken."""

from collections.abc import Callable, Sequence
from pathlib import Path

from contracts.cameras import Camera
from contracts.sim import TruthQuestion, TruthView
from contracts.vlm_gateway import Match
from evaluation.offline.questions import Given, RecordedQuestion, by_flight
from evaluation.sim_client import SimClient
from evaluation.subtasks.stage import staged
from evaluation.subtasks.stops import Stop
from mission.record import read_question

SEEN_SHARE, SEEN_PIXELS, SEEN_M = 0.4, 80, 25.0
"""From when on an object counts as seen, in pictures with a focal length of `FOCAL_PX`: as for the `oracle`."""
FOCAL_PX, MAX_SIDE_PX = 400.0, 1600


def true_answers(
    questions: Sequence[RecordedQuestion], simulator: SimClient, told: Callable[[Given], None]
) -> dict[str, Given]:
    """The truth of every question about a place in a scene that can be flown to; `told` hears of each. Raises
    evaluation.sim_client.SimulatorFault, OSError, mission.record.BadRecord."""
    found: dict[str, Given] = {}
    for flight in by_flight([q for q in questions if q.pose is not None]):
        asked = read_question(Path(flight[0].folder))
        if asked.scene is None:
            continue
        with staged(simulator, asked.scene, asked.settings.rig_flown) as stage:
            for question in flight:
                pose = question.pose
                if pose is None or not stage.go(Stop(pose.x, pose.y, pose.z, pose.yaw)):
                    continue
                cameras = tuple(_sharp(camera) for camera in question.cameras)
                views = simulator.truth(stage.episode, TruthQuestion(cameras=cameras)).views
                found[question.id] = _answer(question, views)
                told(found[question.id])
    return found


def _answer(question: RecordedQuestion, views: Sequence[TruthView]) -> Given:
    if question.kind == "floor-count":
        return Given(question=question.id, outcome="answered", floors=views[0].floors_visible)
    matches = tuple(
        Match(camera=view.camera, box=thing.box)
        for view in views
        for thing in view.objects
        if thing.goal and thing.share >= SEEN_SHARE and thing.pixels >= SEEN_PIXELS and thing.distance_m <= SEEN_M
    )
    return Given(question=question.id, outcome="answered", found=bool(matches), matches=matches)


def _sharp(camera: Camera) -> Camera:
    """With pixels as fine as the thresholds mean them."""
    side = round(FOCAL_PX / camera.fx_px * max(camera.width, camera.height))
    return camera.scaled_to(min(MAX_SIDE_PX, side))

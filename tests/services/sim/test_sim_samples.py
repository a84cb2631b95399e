"""The deliveries that ship with the project, flown by one who knows the way: each can be delivered."""

import math
from pathlib import Path

import pytest

from contracts.geometry import Point3
from contracts.orchestrator import Sample
from contracts.scene_layout import goal_window
from contracts.sim import Claim, EpisodeQuestion
from contracts.vehicle import Move
from navigation.shortest_path import Route, shortest_route
from services.sim.bootstrap import build_scene
from services.sim.episode import LiveEpisode
from services.sim.scenes import make_ready

SAMPLES = sorted((Path(__file__).parents[3] / "orchestrator" / "samples").glob("*.json"))
STOP_M = 2.2


@pytest.mark.slow
@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_the_goal_of_a_sample_can_be_flown_to_and_is_judged_delivered(path: Path) -> None:
    scene = Sample.model_validate_json(path.read_text(encoding="utf-8")).scene
    ready = make_ready(scene, build_scene)
    episode = LiveEpisode("sample", ready, EpisodeQuestion(scene=scene), "tiny", "none")
    try:
        window = goal_window(scene)
        assert window is not None
        stop = (window.centre[0] + window.normal[0] * STOP_M, window.centre[1] + window.normal[1] * STOP_M)
        start = episode.drone.pose
        outlines = [[(p.x, p.y) for p in building.footprint] for building in scene.buildings]
        way = shortest_route((start.x, start.y), stop, outlines, STOP_M)
        assert isinstance(way, Route)
        path3 = tuple(Point3(x=x, y=y, z=max(1.0, window.centre[2])) for x, y in way.waypoints)
        assert episode.begin(1, Move(path=path3)) is None
        assert episode.advance(math.inf)
        flown = episode.result(1)
        assert flown.hit is None
        assert flown.path_m >= math.dist((start.x, start.y), stop)
        x, y, z = ready.things[scene.goal or ""].middle
        verdict = episode.claim(Claim(target=Point3(x=x, y=y, z=z)))
        assert verdict.delivered, verdict
        assert verdict.distance_m == pytest.approx(STOP_M, abs=0.05)
    finally:
        episode.close()


def test_there_are_samples_to_fly() -> None:
    assert len(SAMPLES) >= 6

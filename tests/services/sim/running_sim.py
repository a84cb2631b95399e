"""What the tests of the simulator over HTTP share: one that runs, short ways to ask it, and a flight."""

from collections.abc import Callable
from typing import Any

import httpx

from contracts.cameras import default_rig
from contracts.scene import Scene
from contracts.sim import Catalogue, CatalogueEntry, Episode
from contracts.vehicle import Observation
from services.sim.episodes import Episodes
from services.sim.geometry.scene_mesh import SceneMesh

Builder = Callable[[Scene], SceneMesh]
BEFORE_THE_POT = [{"x": 0.0, "y": -15.0, "z": 7.65}, {"x": 0.0, "y": -7.0, "z": 7.65}]
CATALOGUE = Catalogue(
    entries=(
        CatalogueEntry(
            kind="flower_pot",
            category="ornaments",
            phrase="flower pot",
            synonyms=("planter",),
            colours=("green", "red"),
            places=("sill",),
            size_m=(0.5, 0.5, 0.5),
        ),
    )
)


class Simulator:
    """One running simulator and short ways to ask it."""

    def __init__(self, url: str, episodes: Episodes) -> None:
        self.http = httpx.Client(base_url=url, timeout=120.0)
        self.url = url
        self.episodes = episodes

    def start(self, scene: Scene, size: int = 64, **more: Any) -> Episode:
        """An episode with the paper's five cameras, their pictures `size` pixels square."""
        answer = self.http.post("/v1/episodes", json=self.question(scene, size, **more))
        assert answer.status_code == 201, answer.text
        return Episode.model_validate_json(answer.content)

    def question(self, scene: Scene, size: int = 64, **more: Any) -> dict[str, Any]:
        rig = default_rig().scaled_to(size)
        return {"scene": scene.model_dump(mode="json"), "rig": rig.model_dump(mode="json"), **more}

    def move(self, episode: str, number: int, path: list[dict[str, float]], **more: Any) -> httpx.Response:
        return self.http.put(f"/v1/episodes/{episode}/moves/{number}", json={"path": path, **more})

    def look(self, episode: str, **query: Any) -> Observation:
        answer = self.http.get(f"/v1/episodes/{episode}/observation", params=query)
        assert answer.status_code == 200, answer.text
        return Observation.model_validate_json(answer.content)


def error(answer: httpx.Response) -> tuple[int, str, str]:
    body = answer.json()["error"]
    return answer.status_code, body["code"], body["message"]

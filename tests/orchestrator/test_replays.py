"""The pages over a run's records, while it is flown and afterwards; over real HTTP."""

import asyncio
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from contracts.event_data import NoData, PlacedData
from contracts.geometry import Pose
from contracts.orchestrator import Delivery, DeliveryQuestion
from contracts.overview import Overview
from mission.record import Record, failed, now
from orchestrator.replay_app import build_replay_app
from orchestrator.replays import Replays
from orchestrator.store.lines import Chosen
from orchestrator.streets import street_of
from tests.conftest import Serve
from tests.mission.block import Block, block_scene


def record(run: Path, task: str, request: str = "floor 4") -> Record:
    """As a worker of `bench` opens it."""
    question = DeliveryQuestion(request=request, scene=block_scene(Block()))
    delivery = Delivery(
        id=task, status="waiting", phase="parse", request=request, scene="block", created=now(), folder=None
    )
    return Record(run / "episodes" / task, delivery, question)


def placed(one: Record, pose: Pose) -> None:
    one.write(1, "place", "at the start", PlacedData(vehicle="e1", pose=pose))


def end(one: Record) -> None:
    result = failed("nobody answers")
    one.conclude(result)
    one.announce(result)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run of which one episode is over, one is flown, one was cut off."""
    over, broken = record(tmp_path, "005", "the window with a cake"), record(tmp_path, "007")
    end(over)
    broken.write(1, "parse", "reading", NoData())
    broken.close()
    return tmp_path


def test_a_run_is_looked_at_while_it_is_flown(run: Path, serve: Serve) -> None:
    flown = record(run, "006")
    flown.write(1, "parse", "reading the request", NoData(), lambda: {"view": b"a picture"})
    with httpx.Client(base_url=serve(build_replay_app(Replays(run))), timeout=20) as client:
        shown = Overview.model_validate(client.get("/v1/overview").json())
        states = {line.id: (line.status, line.outcome) for line in shown.deliveries}
        assert states == {"005": ("done", "failed"), "006": ("flying", None), "007": ("done", "failed")}
        assert client.get("/v1/deliveries/007").json()["result"]["message"].startswith("the record breaks off")
        assert [line["id"] for line in client.get("/v1/overview?text=CAKE").json()["deliveries"]] == ["005"]
        first = client.get("/v1/overview?limit=1").json()
        assert client.get(f"/v1/overview?limit=2&before={first['next']}").json()["next"] is None
        unknown = client.get("/v1/overview?before=none-such")
        assert (unknown.status_code, unknown.json()["error"]["code"]) == (404, "not_found")
        lines = []
        with client.stream("GET", "/v1/deliveries/006/events?drone=true") as stream:
            for line in stream.iter_lines():
                lines.append(line)
                if "reading the request" in line:
                    end(flown)
        assert [line for line in lines if line.startswith("event:")] == ["event: step", "event: step", "event: end"]
        assert client.get("/v1/deliveries/006").json()["status"] == "done"
        assert client.get("/v1/deliveries/006/street").json()["name"] == "block"
        assert client.get("/v1/deliveries/006/files/0001_view.jpg").content == b"a picture"
        assert client.get("/v1/session").json() == {"role": "read_only", "asked": False}
        assert "script-src 'self'" in client.get("/").headers["content-security-policy"]


def test_a_flight_is_shown_where_its_record_has_it_last(run: Path) -> None:
    pose = Pose(x=1.0, y=2.0, z=3.0, yaw=0.5)
    before, after = record(run, "008"), record(run, "009")
    placed(after, pose)
    shown = asyncio.run(Replays(run).overview(Chosen(10)))
    street = street_of(block_scene(Block())).key
    assert {f.delivery: (f.street, f.stop, f.drone) for f in shown.flights} == {
        "008": (street, None, None),
        "009": (street, pose, None),
    }
    end(after)
    assert [f.delivery for f in asyncio.run(Replays(run).overview(Chosen(10))).flights] == ["008"]
    before.close()


def test_a_page_goes_on_after_a_record_that_the_filter_leaves_out(run: Path, serve: Serve) -> None:
    with httpx.Client(base_url=serve(build_replay_app(Replays(run)))) as client:
        newest, *older = (line["id"] for line in client.get("/v1/overview").json()["deliveries"])
        shown = client.get("/v1/overview", params={"before": newest, "status": "done"}).json()["deliveries"]
        assert [line["id"] for line in shown] == older
        assert client.get("/v1/overview", params={"before": newest, "status": "flying"}).json()["deliveries"] == []


def test_the_pages_over_records_need_no_durable_engine() -> None:
    program = "import sys, orchestrator.replay_app; print('dbos' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stdout == "False\n"


@pytest.mark.parametrize(
    "path", ["008", "008/events", "%2e%2e", "005/files/state.json", "005/files/..%2f..%2f..%2fsettings.json"]
)
def test_what_is_no_record_is_not_found(run: Path, serve: Serve, path: str) -> None:
    (run / "settings.json").write_text("{}")
    with httpx.Client(base_url=serve(build_replay_app(Replays(run)))) as client:
        answer = client.get(f"/v1/deliveries/{path}")
        assert (answer.status_code, "error" in answer.json()) == (404, True)


def test_a_run_is_looked_at_before_its_first_episode_has_begun(tmp_path: Path, serve: Serve) -> None:
    run = tmp_path / "run"
    run.mkdir()
    with httpx.Client(base_url=serve(build_replay_app(Replays(run))), timeout=20) as client:
        assert client.get("/v1/overview").json()["deliveries"] == []
        flown = record(run, "006")
        flown.write(1, "parse", "reading the request", NoData())
        assert [line["id"] for line in client.get("/v1/overview").json()["deliveries"]] == ["006"]
        end(flown)

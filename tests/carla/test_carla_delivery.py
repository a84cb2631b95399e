"""Whole deliveries in CARLA: the real client in the double's streets, the services as processes, and the mission as it
flies everywhere."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from contracts.orchestrator import DeliveryQuestion, MissionSettings
from launcher.processes import Processes, free_ports
from mission.clients import Services
from mission.outages import Patience
from orchestrator.delivery import Order, Run
from service_kit.addresses import Addresses
from service_kit.settings import process_environment
from tests.carla.doubles import DoubleProcess

pytestmark = pytest.mark.carla
SERVED = ("llm_parser", "vlm_gateway", "depth_assist", "carla_world")
SAMPLES = ("villa-teddy-bear", "green-flower-pot")


@pytest.fixture(scope="module")
def at(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Addresses]:
    """The services of a flight; in the simulator's place stands the one that flies in CARLA."""
    folder = tmp_path_factory.mktemp("carla")
    for sample in SAMPLES:
        (folder / f"{sample}.toml").write_text(f'map = "{sample}"\n')
    with DoubleProcess(folder / "double.log") as double:
        extra = {"carla_world": {"CARLA": double.address, "CARLA_SCENES": str(folder), "CARLA_TIMEOUT_S": "120"}}
        ports = free_ports(SERVED)
        group = Processes(ports, folder / "logs", environment=process_environment(), extra=extra)
        try:
            group.start()
            yield Addresses(**{name: f"http://127.0.0.1:{ports[name]}" for name in SERVED[:3]}, sim=_url(ports))
        finally:
            group.stop()


def _url(ports: dict[str, int]) -> str:
    return f"http://127.0.0.1:{ports['carla_world']}"


@pytest.mark.parametrize("sample", SAMPLES)
async def test_a_sample_is_delivered_in_carla(sample: str, at: Addresses, tmp_path: Path) -> None:
    order = Order(DeliveryQuestion(sample=sample, backend="embedded", settings=MissionSettings()))
    async with Services(at) as services:
        run = Run(order, tmp_path)
        result = await run.fly(services.simulated(), patience=Patience(60.0))
    assert result.outcome == "delivered", result
    assert result.verdict is not None
    assert result.verdict.delivered
    assert not result.verdict.collided
    assert result.renderer == "carla"

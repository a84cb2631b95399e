"""Services as child processes: what does not start is told by name."""

import asyncio
import socket
import time
from pathlib import Path

import pytest

from launcher.processes import STARTED_WITH, CannotStart, Processes, free_ports, is_free, parse_addresses
from service_kit.settings import process_environment


def test_a_service_that_ends_while_starting_is_reported_with_its_last_words(tmp_path: Path) -> None:
    ports = free_ports(["depth_assist"])
    environment = process_environment() | {"DEPTH_ASSIST_MAX_BODY_BYTES": "many"}
    group = Processes(ports, tmp_path / "logs", environment=environment)

    async def start() -> None:
        async with group:
            pass

    with pytest.raises(CannotStart, match="DEPTH_ASSIST_MAX_BODY_BYTES"):
        asyncio.run(start())
    assert group.children[0].process.returncode != 0


def test_a_wrong_file_of_the_gateways_is_told_before_any_other_service_is_started(tmp_path: Path) -> None:
    config = tmp_path / "gateway.toml"
    config.write_text('[roles]\nrecognise = "embedded"\n')
    environment = process_environment() | {"GATEWAY_CONFIG": str(config)}
    group = Processes(free_ports(["depth_assist", "vlm_gateway"]), tmp_path / "logs", environment=environment)

    async def start() -> None:
        async with group:
            pass

    with pytest.raises(CannotStart, match=r"gateway\.toml: roles\.recognise: no such role"):
        asyncio.run(start())
    assert [child.name for child in group.children] == ["vlm_gateway"]


def test_a_taken_port_is_named_before_anything_is_started(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert not is_free(port)
        group = Processes({"sim": port}, tmp_path / "logs", environment=process_environment())
        with pytest.raises(CannotStart, match=str(port)):
            group.start()
    assert not group.children


def test_addresses_are_read_by_name_and_the_rest_keep_their_usual_ports() -> None:
    at = parse_addresses("sim=http://127.0.0.1:9000, vlm_gateway=https://models.example")
    assert at.sim == "http://127.0.0.1:9000"
    assert at.vlm_gateway == "https://models.example"
    assert at.depth_assist == "http://127.0.0.1:8103"


@pytest.mark.parametrize("own", [{}, {"GLIBC_TUNABLES": "glibc.malloc.tcache_count=3"}])
def test_the_orchestrator_keeps_no_freed_memory_by_thread_unless_the_environment_says_so(
    tmp_path: Path, own: dict[str, str]
) -> None:
    environment = {k: v for k, v in process_environment().items() if k != "GLIBC_TUNABLES"} | own
    environment["RUNS_DIR"] = str(tmp_path / "runs")
    group = Processes(free_ports(["orchestrator"]), tmp_path / "logs", environment=environment)
    group.start()
    try:
        [child] = group.children
        environ = Path(f"/proc/{child.process.pid}/environ")
        while not (started_with := environ.read_text()):  # a child that has not begun its program has none yet
            assert child.process.poll() is None
            time.sleep(0.01)
    finally:
        group.kill()
        group.stop()
    (tunables,) = (STARTED_WITH["orchestrator"] | own).values()
    # the C library cuts its variable in pieces where it stands
    assert f"GLIBC_TUNABLES={tunables}\0" in started_with.replace("\0glibc.", ":glibc.")

"""Services that end are started again; whoever ends again and again is named."""

import asyncio
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from contracts.health import Health
from launcher.processes import Processes, free_ports
from launcher.supervisor import GaveUp, RestartPolicy, Supervisor
from service_kit.client import ServiceClient, Unreachable
from service_kit.settings import process_environment


@asynccontextmanager
async def supervised(
    folder: Path, said: list[str], policy: RestartPolicy
) -> AsyncIterator[tuple[Processes, Supervisor]]:
    async with Processes(free_ports(["depth_assist"]), folder, environment=process_environment()) as group:
        yield group, Supervisor(group, said.append, policy)


async def test_a_killed_service_is_started_again_at_its_address(tmp_path: Path) -> None:
    said: list[str] = []
    async with supervised(tmp_path, said, RestartPolicy()) as (group, supervisor):
        kept = asyncio.create_task(supervisor.run())
        first = group.children[0].process
        first.send_signal(signal.SIGKILL)
        first.wait()
        async with ServiceClient("depth_assist", group.children[0].url) as client, asyncio.timeout(60):
            assert await answered(client) == "ok"
        kept.cancel()
        with suppress(asyncio.CancelledError):
            await kept
    assert said[0].startswith("depth_assist was ended by SIGKILL")
    assert said[0].endswith("it is started again in 0.25 s")
    assert group.children[0].process is not first


async def test_a_service_that_ends_again_and_again_is_given_up_by_name(tmp_path: Path) -> None:
    said: list[str] = []
    async with supervised(tmp_path, said, RestartPolicy(times=1)) as (group, supervisor):
        group.children[0].process.kill()
        killing = asyncio.create_task(kill_when_ready_again(group, said))
        with pytest.raises(GaveUp) as gave_up:
            await asyncio.wait_for(supervisor.run(), 60)
        await killing
    message = str(gave_up.value)
    assert message.startswith(
        "depth_assist ended 2 times within 60 s and is given up; depth_assist was ended by SIGKILL"
    )
    assert message.endswith("depth_assist.log")


async def answered(client: ServiceClient) -> str:
    """What a service says of itself once it is there."""
    while True:
        with suppress(Unreachable):
            return (await client.call("GET", "/healthz", Health)).status
        await asyncio.sleep(0.1)


async def kill_when_ready_again(group: Processes, said: list[str]) -> None:
    for _ in range(600):
        if "depth_assist is ready again" in said:
            break
        await asyncio.sleep(0.1)
    group.children[0].process.kill()

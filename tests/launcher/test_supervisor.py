"""Services that end are started again; calls wait for them; whoever ends again and again is named."""

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


async def test_a_killed_service_is_started_again_and_whoever_calls_it_waits(tmp_path: Path) -> None:
    said: list[str] = []
    async with supervised(tmp_path, said, RestartPolicy()) as (group, supervisor):
        kept = asyncio.create_task(supervisor.run())
        first = group.children[0].process
        first.send_signal(signal.SIGKILL)
        first.wait()
        async with ServiceClient("depth_assist", group.children[0].url, patience_s=60) as patient:
            assert (await patient.call("GET", "/healthz", Health)).status == "ok"
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


async def kill_when_ready_again(group: Processes, said: list[str]) -> None:
    for _ in range(600):
        if "depth_assist is ready again" in said:
            break
        await asyncio.sleep(0.1)
    group.children[0].process.kill()


async def test_impatience_is_told_at_once_and_patience_runs_out() -> None:
    port = free_ports(["depth_assist"])["depth_assist"]
    for patience_s, at_least_s in ((0.0, 0.0), (0.5, 0.3)):
        async with ServiceClient("depth_assist", f"http://127.0.0.1:{port}", patience_s=patience_s) as client:
            started = asyncio.get_running_loop().time()
            with pytest.raises(Unreachable, match="depth_assist"):
                await client.call("GET", "/healthz", Health)
            assert at_least_s <= asyncio.get_running_loop().time() - started < 5.0

"""The commands of docs/vehicles.md run as they stand."""

import asyncio
import json
import os
import re
from asyncio.subprocess import PIPE
from pathlib import Path
from typing import Any

from launcher.processes import Processes, free_ports
from service_kit.settings import process_environment

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "vehicles.md"


def commands() -> str:
    blocks = re.findall(r"```sh\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 3
    return "set -e\n" + "\n".join(blocks)


def answers(text: str) -> list[dict[str, Any]]:
    """The JSON objects in a text, one straight after the other; what is cut off is passed over."""
    decoder, found, at = json.JSONDecoder(), [], text.find("{")
    while at >= 0:
        try:
            value, end = decoder.raw_decode(text, at)
            found.append(value)
        except ValueError:
            end = at + 1
        at = text.find("{", end)
    return found


async def test_the_pages_commands_fly_stop_return_land_and_end_a_trial(tmp_path: Path) -> None:
    ports = free_ports(("sim",))
    environment = os.environ | {"SIM": f"http://127.0.0.1:{ports['sim']}"}
    async with Processes(ports, tmp_path, environment=process_environment()):
        shell = await asyncio.create_subprocess_exec(
            "bash", "-c", commands(), cwd=ROOT, env=environment, stdout=PIPE, stderr=PIPE
        )
        said, complaint = await asyncio.wait_for(shell.communicate(), 120)
    assert shell.returncode == 0, complaint.decode()
    told = answers(said.decode())
    assert any(answer.get("state") == "flying" for answer in told)
    stopped = [answer for answer in told if answer.get("cancelled")]
    assert len(stopped) == 2
    assert stopped[0] == stopped[1]
    assert any(answer.get("mode") == "landed" for answer in told)
    assert any(answer.get("status") == "claimed" for answer in told)

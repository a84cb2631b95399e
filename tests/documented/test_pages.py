"""Every document's commands run as they stand, one after the other, in a folder with what a reader has."""

import asyncio
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import Route

from launcher.processes import Processes, free_ports, oracle_settings
from service_kit.addresses import PORTS
from service_kit.settings import process_environment
from tests.conftest import Serve
from tests.documented.commands import DOCUMENTS, ROOT, blocks_of, commands_of, named
from tests.documented.left_out import LEFT_OUT, PAGES
from tests.documented.shortened import CUTS, shortened
from tests.documented.test_commands_are_there import check
from tests.evaluation.own_scenes.test_osm import Extract, box

LINKED = ("contracts", "deploy", "evaluation", "orchestrator", "services", "tests")
SHIM = '#!/bin/sh\nexec "{python}" -m tests.documented.shortened {program} "$@"\n'
CONFIG = """[models.qwen]
backend = "chat"
preset = "qwen2.5-vl"
server = "vllm"
base_url = "{url}/v1"
model = "Qwen/Qwen2.5-VL-7B-Instruct"
"""
SAYS = {"role": "assistant", "content": '{"floors": 3}'}


def left_out(line: str) -> bool:
    return any(re.match(pattern, line) for pattern, _ in LEFT_OUT)


def lines_of(document: Path) -> list[str]:
    """Its blocks of commands, less what is left out: a program for a shell."""
    kept = []
    for block in blocks_of(document):
        told = [line for line in block.splitlines() if re.match(r"[A-Z][a-z]+ +\w", line)]
        lines = [] if told else block.splitlines()  # what a command says is no command
        kept += [line for line in lines if not left_out(line.strip())]
    return kept


RUN = [d for d in DOCUMENTS if named(d) not in PAGES and any(re.match(r"[^#\s.]", line) for line in lines_of(d))]


async def completion(request: Request) -> JSONResponse:
    choice = {"index": 0, "message": SAYS, "finish_reason": "stop"}
    return JSONResponse({"id": "c", "object": "chat.completion", "created": 1, "model": "m", "choices": [choice]})


@pytest.fixture
def page(tmp_path: Path, serve: Serve) -> Path:
    """The folder in which a reader is: the repository as far as documents name it, and files that they bring."""
    for name in LINKED:
        (tmp_path / name).symlink_to(ROOT / name)
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    (tmp_path / "secrets").mkdir()
    (programs := tmp_path / ".venv" / "bin").mkdir(parents=True)
    (programs / "activate").touch()
    for program in ("logisticsvln", "python", "curl"):
        (programs / program).write_text(SHIM.format(python=sys.executable, program=program))
        (programs / program).chmod(0o755)
    model = serve(Starlette(routes=[Route("/v1/chat/completions", completion, methods=["POST"])]))
    (tmp_path / "gateway.toml").write_text(CONFIG.format(url=model))
    rig = re.search(r'```toml\n(name = "my-drone".*?)```', (ROOT / "docs" / "rigs.md").read_text("utf-8"), re.DOTALL)
    assert rig is not None
    (tmp_path / "my-drone.toml").write_text(rig[1])
    shutil.copy(next(ROOT.glob("**/d455.toml")), tmp_path / "my.toml")
    some = (ROOT / "tests" / "data" / "requests_kept_apart.jsonl").read_text("utf-8").splitlines(keepends=True)
    for name, lines in (("a", some[:20]), ("b", some[20:30])):
        (tmp_path / f"{name}.jsonl").write_text("".join(lines), "utf-8")
    Extract().way(4711, box(0, 0), building="yes", building__levels="5").write(tmp_path).rename(
        tmp_path / "streets.osm"
    )
    return tmp_path


def with_services(page: Path) -> Processes:
    ports = free_ports(PORTS)
    extra = oracle_settings(ports)
    extra["orchestrator"] = {"RUNS_DIR": str(page / "deliveries")}
    extra["vlm_gateway"] |= {"GATEWAY_CONFIG": str(page / "gateway.toml")}
    return Processes(ports, page / "logs", environment=process_environment(), extra=extra)


def environment(page: Path, ports: Mapping[str, int]) -> dict[str, str]:
    curl = shutil.which("curl")
    assert curl is not None, "curl is not installed"
    return os.environ | {
        "PATH": f"{page / '.venv' / 'bin'}:{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "HOME": str(page),
        "GATEWAY_CONFIG": str(page / "gateway.toml"),
        "SLURM_ARRAY_TASK_ID": "1",
        "DOCUMENTED_PAGE": str(page),
        "DOCUMENTED_CURL": curl,
        "DOCUMENTED_PORTS": json.dumps({str(PORTS[name]): port for name, port in ports.items()}),
    }


def ran(page: Path) -> list[dict[str, Any]]:
    log = page / "ran.jsonl"
    return [json.loads(line) for line in log.read_text("utf-8").splitlines()] if log.exists() else []


def read_out(page: Path, script: list[str], ports: Mapping[str, int]) -> None:
    program = "\n".join(["set -e -o pipefail", *script])
    done = subprocess.run(
        ["bash", "-c", program], cwd=page, env=environment(page, ports), capture_output=True, text=True, timeout=1700
    )
    assert done.returncode == 0, (ran(page)[-1:], (done.stdout + done.stderr)[-4000:])
    assert "Traceback" not in done.stderr


@pytest.mark.documents
@pytest.mark.parametrize("document", RUN, ids=named)
async def test_the_commands_of_a_document_run_one_after_the_other(document: Path, page: Path) -> None:
    script = lines_of(document)
    if not any("curl" in line or " vehicles" in line for line in script):
        return read_out(page, script, {})
    async with with_services(page) as group:
        ports = {child.name: int(child.url.rpartition(":")[2]) for child in group.children}
        return await asyncio.to_thread(read_out, page, script, ports)


CHEAP = r"\S*logisticsvln (samples|tasks stats|scene (new|from-osm))\b|\S*python -(c|m services\.vlm_gateway\.keys)"


def test_what_costs_little_runs_as_it_stands(page: Path) -> None:
    script = [line for document in DOCUMENTS for line in lines_of(document) if re.match(CHEAP, line)]
    read_out(page, list(dict.fromkeys(script)), {})
    assert [one["command"].split()[1] for one in ran(page)].count("scene") == 2
    assert {one["code"] for one in ran(page)} == {0}
    assert len(ran(page)) >= 7


def test_each_line_left_out_is_one_of_a_document_and_says_why() -> None:
    lines = [line.strip() for document in DOCUMENTS for block in blocks_of(document) for line in block.splitlines()]
    for pattern, why in LEFT_OUT:
        assert any(re.match(pattern, line) for line in lines), pattern
        assert why


@pytest.mark.parametrize("document", RUN, ids=named)
def test_a_command_that_is_cut_short_is_cut_by_options_that_it_has(document: Path) -> None:
    for command in commands_of(document):
        if command.whole and (more := shortened(command.line)):
            assert check((*command.words, *more), whole=True) is None
    assert CUTS

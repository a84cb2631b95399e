"""`logisticsvln doctor`: does this machine have what is needed, and what to do where it has not."""

import asyncio
import contextlib
import importlib.metadata
import json
import os
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple
from urllib.parse import urlsplit

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from command_line.console import FAILED, INTERRUPTED, interruptible, stop
from command_line.running_services import ask_services
from launcher.processes import CannotStart, Processes, free_ports, is_free
from orchestrator import sample_library
from service_kit.addresses import PORTS
from service_kit.connections import Connections
from service_kit.settings import BadSetting, process_environment, secret

ENOUGH_DISK_BYTES = 1 << 30
NOT_FOR_FLYING = ("all", "carla", "eval", "lerobot", "mcap", "otel", "rerun", "train")
"""Extras of the project that no service and no flight needs; `all` holds others besides."""
INSTALL = "`make setup`, or `pip install '.[all]'` in the repository's folder, into an environment of your own"
CALIBRATION = "services.vlm_gateway.calibration"
GL_PROBE = """
import moderngl
context = moderngl.create_context(standalone=True, backend="egl")
print(context.info["GL_RENDERER"], "|", context.info["GL_VERSION"])
"""


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    out: Annotated[Path, typer.Option(help="Where records go.")] = Path("runs"),
    model: Annotated[
        str | None,
        typer.Option("--calibrate", help="An alias of the gateway: find out how this vision model writes boxes."),
    ] = None,
    gateway: Annotated[
        str | None, typer.Option(help="A running gateway, for --calibrate; else one is started for it.")
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, max=20, help="Pictures to show, for --calibrate.")] = 3,
) -> None:
    """Look whether this machine has what is needed, and say what to do about what it hasn't."""
    if model is not None:
        try:
            raise typer.Exit(
                asyncio.run(interruptible(calibrate(model, gateway, rounds, out / "logs", as_json=as_json)))
            )
        except CannotStart as error:
            stop(f"the gateway could not be started: {error}", FAILED)
        except asyncio.CancelledError:
            stop("interrupted before the last picture", INTERRUPTED)
    findings = examine(process_environment(), out)
    if as_json:
        typer.echo(json.dumps({"ok": all(f.ok for f in findings), "findings": [f._asdict() for f in findings]}))
    else:
        print_findings(Console(), findings)
    raise typer.Exit(0 if all(f.ok for f in findings) else 1)


class Finding(NamedTuple):
    """One thing that was looked at; `remedy` says what to do where it is not ok, or could be better."""

    name: str
    ok: bool
    found: str
    remedy: str = ""


def examine(environment: Mapping[str, str], runs: Path) -> list[Finding]:
    """All findings; nothing is changed on the machine, except that the folder of the records is made."""
    machine = [_python(), _packages(), _renderer()]
    services = [_settings(environment), _services(environment), _redis(environment), *_ports()]
    return [*machine, *services, _disk(runs), _samples()]


def _python() -> Finding:
    version = ".".join(str(part) for part in sys.version_info[:3])
    good = (3, 11) <= sys.version_info[:2] <= (3, 12)
    return Finding("Python", good, version, "" if good else "use Python 3.11, then `make setup`")


def _packages() -> Finding:
    try:
        requirements = importlib.metadata.requires("logisticsvln") or []
    except importlib.metadata.PackageNotFoundError:
        return Finding("Packages", False, "the project itself is not installed", INSTALL)
    missing = [name for name in required_packages(requirements) if not _there(name)]
    found = f"missing: {', '.join(missing)}" if missing else "all there"
    return Finding("Packages", not missing, found, INSTALL if missing else "")


def required_packages(requirements: Sequence[str]) -> list[str]:
    """The distributions that the services and commands need, of the project's own `requirements` (PEP 508): all but
    those of the extras for charts and for training, and of other Pythons."""
    names = set()
    for line in requirements:
        requirement, _, marker = line.partition(";")
        extra = re.search(r"extra == [\"']([a-z-]+)[\"']", marker)
        if (extra is None or extra[1] not in NOT_FOR_FLYING) and _for_this_python(marker):
            names.add(re.split(r"[^A-Za-z0-9._-]", requirement.strip(), maxsplit=1)[0])
    return sorted(names)


def _for_this_python(marker: str) -> bool:
    limits = re.findall(r"python_version (<|>=) [\"'](\d+)\.(\d+)[\"']", marker)
    at_least = {">=": True, "<": False}
    return all((sys.version_info[:2] >= (int(a), int(b))) is at_least[sign] for sign, a, b in limits)


def _there(distribution: str) -> bool:
    try:
        importlib.metadata.distribution(distribution)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def _renderer() -> Finding:
    said = _output(GL_PROBE).strip()
    if "|" in said:
        return Finding("Renderer", True, f"moderngl on EGL: {said.replace(' | ', ', OpenGL ')}")
    tiny = "print('ok') if __import__('importlib.util').util.find_spec('pybullet') else None"
    usable = "ok" in _output(tiny)
    return Finding(
        "Renderer",
        usable,
        f"no OpenGL on EGL ({said.splitlines()[-1][:120] if said else 'no answer'}); "
        + ("PyBullet's slow TinyRenderer is used" if usable else "and no PyBullet either"),
        "install libegl1, libgl1 and libgl1-mesa-dri for pictures ten times as fast",
    )


def _settings(environment: Mapping[str, str]) -> Finding:
    """The addresses and tokens of the services, which every command reads."""
    try:
        tokens = Connections.read(environment).tokens
    except BadSetting as error:
        return Finding("Settings", False, str(error), "docs/configuration.md lists every variable")
    held = [name for name, token in tokens._asdict().items() if token]
    return Finding("Settings", True, f"tokens for {', '.join(held)}" if held else "no tokens are set")


def _services(environment: Mapping[str, str]) -> Finding:
    """Those that run are asked whether the tokens fit."""
    try:
        running = asyncio.run(ask_services(environment))
    except BadSetting:
        return Finding("Services", True, "not asked: the settings are wrong")
    misfits = [f"{one.service} {one.misfit}" for one in running if one.misfit]
    found = "; ".join(one.said for one in running) or "none runs at the addresses that are set"
    return Finding("Services", not misfits, found, "; ".join(misfits))


def _redis(environment: Mapping[str, str]) -> Finding:
    try:
        url = secret(environment, "REDIS_URL")
    except BadSetting as error:
        return Finding("Redis", False, str(error), "or unset it: the gateway then uses its SQLite file")
    if url:
        parts = urlsplit(url)
        there = _listens(parts.hostname or "127.0.0.1", parts.port or 6379)
        return Finding(
            "Redis",
            there,
            f"REDIS_URL is set and {'answers' if there else 'does not answer'}",
            "" if there else "start that server, or unset REDIS_URL: the gateway then uses its SQLite file",
        )
    program = shutil.which("redis-server")
    return Finding(
        "Redis",
        True,
        "REDIS_URL is not set: the gateway caches in an SQLite file",
        "" if program else "only the tests need redis-server: `make test` installs it",
    )


def _ports() -> list[Finding]:
    taken = [f"{name} {port}" for name, port in PORTS.items() if not is_free(port)]
    return [
        Finding(
            "Ports",
            True,
            f"taken: {', '.join(taken)}" if taken else f"{min(PORTS.values())}-{max(PORTS.values())} are free",
            "fine if these are our services; else `logisticsvln serve --base-port`" if taken else "",
        )
    ]


def _disk(runs: Path) -> Finding:
    try:
        runs.mkdir(parents=True, exist_ok=True)
        free = shutil.disk_usage(runs).free
        writable = os.access(runs, os.W_OK)
    except OSError as error:
        return Finding("Disk", False, f"{runs}: {error.strerror}", "choose another folder with --out")
    good = writable and free >= ENOUGH_DISK_BYTES
    remedy = "" if good else "make room or choose another folder with --out (a delivery takes 5 to 30 MB)"
    return Finding(
        "Disk", good, f"{free / 1e9:.1f} GB free for {runs}" + ("" if writable else ", not writable"), remedy
    )


def _samples() -> Finding:
    names = sample_library.names()
    try:
        for name in names:
            sample_library.load(name)
    except ValueError as error:
        return Finding("Samples", False, str(error), "restore orchestrator/samples from the repository")
    found = f"{len(names)}: {', '.join(names)}"
    return Finding("Samples", bool(names), found, "" if names else "restore orchestrator/samples from the repository")


def _output(program: str) -> str:
    """What a Python of its own prints: a crash in a graphics driver must not end the doctor."""
    try:
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=False)
    except subprocess.TimeoutExpired:
        return "no answer within 30 s"
    return done.stdout if done.returncode == 0 else done.stderr


def _listens(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host, port), 1.0):
            return True
    except OSError:
        return False


def print_findings(console: Console, findings: list[Finding]) -> None:
    """For a person: a mark, what was found, and what to do."""
    table = Table.grid(padding=(0, 2))
    for one in findings:
        mark = Text("ok", "green") if one.ok else Text("!!", "bold red")
        table.add_row(mark, one.name, Text(one.found, overflow="fold"))
        if one.remedy:
            table.add_row("", "", Text(f"→ {one.remedy}", "yellow", overflow="fold"))
    console.print(table)


async def calibrate(model: str, gateway: str | None, rounds: int, logs: Path, *, as_json: bool) -> int:
    """The exit status of the gateway's own calibration, run before the `gateway` at that address, or before one that is
    started for it with this process's environment (its GATEWAY_CONFIG). Raises CannotStart."""
    environment = process_environment()
    async with contextlib.AsyncExitStack() as stack:
        if gateway is None:
            # answers of an earlier calibration would tell nothing about the model as it is now
            uncached = environment | {"CACHE_MODE": "off"}
            own = Processes(free_ports(["vlm_gateway"]), logs, environment=uncached)
            gateway = (await stack.enter_async_context(own)).addresses.vlm_gateway
        command = [sys.executable, "-m", CALIBRATION, model, "--gateway", gateway, "--rounds", str(rounds)]
        process = await asyncio.create_subprocess_exec(*command, *["--json"] * as_json, env=environment)
        try:
            return await process.wait()
        finally:
            if process.returncode is None:
                process.terminate()
                await process.wait()

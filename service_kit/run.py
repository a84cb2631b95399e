"""Run one service as a process: JSON log lines, graceful stop on SIGTERM."""

import contextlib
import gc
import json
import logging
import os
import signal
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import uvicorn
from starlette.types import ASGIApp

from service_kit.auth import is_guarded
from service_kit.connections import TOKEN_VARIABLES, Connections
from service_kit.hosts import Hosts, is_loopback
from service_kit.http_limits import ConnectionLimits, OpenConnections, default_limits
from service_kit.http_protocol import ServiceProtocol
from service_kit.settings import BadSetting, ServiceSettings, process_environment
from service_kit.tidying import keep_tidy, share_heaps
from service_kit.workers import Supervisor, Worker, bound_socket

PARENT_WATCH_S = 0.5

log = logging.getLogger("service_kit.run")


S = TypeVar("S", bound=ServiceSettings)


class JsonLines(logging.Formatter):
    """One JSON object a line, for log collectors."""

    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created)) + f".{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if record.exc_info:
            line["trace"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False)


def set_up_logging(level: str) -> None:
    """Log lines go to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)


def main(service: str, kind: type[S], bootstrap: Callable[[S], ASGIApp]) -> None:
    """A service's process: its settings, its app, and serving until the end. Raises SystemExit with one line where the
    settings are wrong."""
    settings = _settings(service, kind)
    app = _built(service, lambda: bootstrap(settings))
    _check_reach(service, app, settings)
    run(app, settings)


def main_in_workers(
    service: str, kind: type[S], workers: Callable[[S], int], bootstrap: Callable[[S, Worker | None], ASGIApp]
) -> None:
    """As `main`; with more than one of `workers` the service is that many processes, and each builds its own app."""
    settings = _settings(service, kind)
    count = workers(settings)
    if count == 1:
        app = _built(service, lambda: bootstrap(settings, None))
        _check_reach(service, app, settings)
        run(app, settings)
        return
    try:
        with bound_socket(settings.host, settings.port) as held:
            _supervised(service, settings, count, bootstrap, held.getsockname()[1])
    except OSError as error:
        raise SystemExit(f"{service} can't start: {settings.host}:{settings.port}: {error.strerror}") from None


def _supervised(
    service: str, settings: S, count: int, bootstrap: Callable[[S, Worker | None], ASGIApp], port: int
) -> None:
    supervisor_pid = os.getpid()

    def serve(worker: Worker) -> None:
        with worker.alone():
            app = _built(service, lambda: bootstrap(settings, worker))
            _check_reach(service, app, settings, say=worker.number == 0)
        mine = settings.model_copy(update={"parent_pid": supervisor_pid})
        run(app, mine, bound_socket(settings.host, port), worker.started)

    if settings.parent_pid:
        threading.Thread(target=_end_with, args=(settings.parent_pid,), name="parent", daemon=True).start()
    with tempfile.TemporaryDirectory(prefix=f"{service}-") as folder:
        started = Supervisor(count, serve, folder).run()
    if not started:
        raise SystemExit(1)


def _settings(service: str, kind: type[S]) -> S:
    share_heaps()
    environment = process_environment()
    try:
        settings = kind.read(environment)
    except BadSetting as error:
        raise SystemExit(f"{service} can't start: {error}") from None
    set_up_logging(settings.log_level)
    for sentence in kind.unknown(environment, Connections.names()):
        log.warning(sentence)
    return settings


def _built(service: str, build: Callable[[], ASGIApp]) -> ASGIApp:
    try:
        return build()
    except BadSetting as error:
        raise SystemExit(f"{service} can't start: {error}") from None


def _check_reach(service: str, app: ASGIApp, settings: ServiceSettings, *, say: bool = True) -> None:
    """Raises SystemExit where strangers could call a service that asks for no token, and nobody said that they may."""
    if is_loopback(settings.host) or is_guarded(app):
        return
    variable = TOKEN_VARIABLES.get(service, "its token")
    reach = f"HOST={settings.host} listens beyond this machine, and whoever reaches it there may do everything"
    if not settings.listen_without_token:
        raise SystemExit(
            f"{service} can't start: {reach}; set {variable} or {variable}_FILE, or HOST=127.0.0.1, or, where "
            "something else keeps strangers out, LISTEN_WITHOUT_TOKEN=on"
        )
    if say:
        log.warning("%s, for LISTEN_WITHOUT_TOKEN is on; %s would ask them for a token", reach, variable)


class _Server(uvicorn.Server):
    """Tells when it serves."""

    def __init__(self, config: uvicorn.Config, started: Callable[[], None]) -> None:
        super().__init__(config)
        self._tell = started

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._tell()


def run(
    app: ASGIApp,
    settings: ServiceSettings,
    listener: socket.socket | None = None,
    started: Callable[[], None] = lambda: None,
) -> None:
    """Serve until SIGTERM or SIGINT, at `listener` where it is given; what is under way then has `drain_timeout_s` to
    end. `started` is called when it serves."""
    if settings.parent_pid:
        threading.Thread(target=_end_with, args=(settings.parent_pid,), name="parent", daemon=True).start()
    limits = connection_limits(settings)
    hosts = Hosts([settings.host, *settings.allowed_hosts.split(",")])
    config = server_config(app, settings.host, settings.port, settings.drain_timeout_s, limits, hosts)
    server = _Server(config, started)
    # what is there by now stays: nobody needs to look through it again and again for what may be thrown away, and
    # what requests leave behind in circles can wait until there is more of it
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    keep_tidy()
    with contextlib.suppress(KeyboardInterrupt):
        server.run(sockets=[listener] if listener is not None else None)


def connection_limits(settings: ServiceSettings) -> ConnectionLimits:
    """What callers may hold."""
    return ConnectionLimits(
        max_connections=settings.max_connections or default_limits().max_connections,
        head_within_s=settings.head_timeout_s,
        body_within_s=settings.body_timeout_s,
        write_within_s=settings.write_timeout_s,
        keep_alive_s=settings.keep_alive_s,
        max_body_bytes_held=settings.max_held_mb << 20,
    )


def server_config(
    app: ASGIApp,
    host: str,
    port: int,
    drain_s: int,
    limits: ConnectionLimits | None = None,
    hosts: Hosts | None = None,
) -> uvicorn.Config:
    """How every service is served. An app with an `http_protocol` speaks HTTP by that; it is called with the server's
    `OpenConnections` and what uvicorn gives."""
    connections = OpenConnections(limits or default_limits(), hosts)
    return uvicorn.Config(
        app,
        host=host,
        port=port,
        http=partial(getattr(app, "http_protocol", ServiceProtocol), connections),  # type: ignore[arg-type]
        ws="none",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=drain_s,
    )


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_WATCH_S)
    os.kill(os.getpid(), signal.SIGTERM)

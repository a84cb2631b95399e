"""Run one service as a process: JSON log lines, graceful stop on SIGTERM."""

import contextlib
import gc
import json
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import TypeVar

import uvicorn
from starlette.types import ASGIApp

from service_kit.connections import Connections
from service_kit.settings import BadSetting, ServiceSettings, process_environment

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
    environment = process_environment()
    try:
        settings = kind.read(environment)
        set_up_logging(settings.log_level)
        for sentence in kind.unknown(environment, Connections.names()):
            log.warning(sentence)
        app = bootstrap(settings)
    except BadSetting as error:
        raise SystemExit(f"{service} can't start: {error}") from None
    run(app, settings)


def run(app: ASGIApp, settings: ServiceSettings) -> None:
    """Serve until SIGTERM or SIGINT."""
    if settings.parent_pid:
        threading.Thread(target=_end_with, args=(settings.parent_pid,), name="parent", daemon=True).start()
    server = uvicorn.Server(server_config(app, settings.host, settings.port, timeout_graceful_shutdown=5))
    # what is there by now stays: nobody needs to look through it again and again for what may be thrown away, and
    # what requests leave behind in circles can wait until there is more of it
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    with contextlib.suppress(KeyboardInterrupt):
        server.run()


def server_config(app: ASGIApp, host: str, port: int, timeout_graceful_shutdown: int) -> uvicorn.Config:
    """How every service is served. An app with an `http_protocol` speaks HTTP by that instead of uvicorn's own."""
    return uvicorn.Config(
        app,
        host=host,
        port=port,
        http=getattr(app, "http_protocol", "httptools"),
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=timeout_graceful_shutdown,
        timeout_keep_alive=30,
    )


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_WATCH_S)
    os.kill(os.getpid(), signal.SIGTERM)

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

import uvicorn
from starlette.types import ASGIApp

from service_kit.settings import Settings

PARENT_WATCH_S = 0.5


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


def run(app: ASGIApp, settings: Settings, default_port: int) -> None:
    """Serve until SIGTERM or SIGINT. `HOST`, `PORT` and `LOG_LEVEL` come from the settings. Where `PARENT_PID` names
    the process that started this one, the service ends with it, however that ended."""
    set_up_logging(settings.choice("LOG_LEVEL", "warning", ("debug", "info", "warning", "error")))
    parent = settings.integer("PARENT_PID", 0, 0, 2**31 - 1)
    if parent:
        threading.Thread(target=_end_with, args=(parent,), name="parent", daemon=True).start()
    host = settings.text("HOST", "127.0.0.1") or "127.0.0.1"
    port = settings.integer("PORT", default_port, 1, 65535)
    server = uvicorn.Server(server_config(app, host, port, timeout_graceful_shutdown=5))
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

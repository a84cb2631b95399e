"""What the gateway's tests share: pictures, chat models over a mock server, gateways on real HTTP."""

import contextlib
import socket
import sqlite3
import time
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import httpx
import numpy as np

from contracts.images import encode_jpeg
from service_kit.metrics import HttpMetrics
from services.vlm_gateway.app import build_app
from services.vlm_gateway.backends.base import Backend, Picture
from services.vlm_gateway.cache.guard import GuardedCache, Mode
from services.vlm_gateway.cache.port import Cache
from services.vlm_gateway.cache.sqlite import SqliteCache
from services.vlm_gateway.chat.backend import ChatBackend
from services.vlm_gateway.config import ChatModel, chat_model
from services.vlm_gateway.gateway import Gateway
from services.vlm_gateway.hot.frontend import Frontend
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.model_configs import ChatModelConfig
from services.vlm_gateway.upstream.client import Upstream
from services.vlm_gateway.usage.accounts import Accounts, Price
from services.vlm_gateway.usage.ledger import Ledger
from services.vlm_gateway.usage.port import UsageStore
from services.vlm_gateway.usage.sqlite import SqliteUsage
from tests.cameras import camera_json
from tests.services.vlm_gateway.openai_mock import OpenAiMock

HEADINGS = (-90, -45, 0, 45, 90)


def picture_base64(width: int = 80, height: int = 60, shade: int = 128) -> str:
    return encode_jpeg(np.full((height, width, 3), shade, np.uint8)).jpeg_base64


def picture(width: int = 80, height: int = 60) -> Picture:
    ok, data = cv2.imencode(".jpg", np.zeros((height, width, 3), np.uint8))
    assert ok
    return Picture(data.tobytes(), width, height)


def floors_body(shade: int = 128, **more: Any) -> dict[str, Any]:
    return {"image": {"jpeg_base64": picture_base64(shade=shade)}, **more}


def find_body(headings: tuple[int, ...] = HEADINGS, **more: Any) -> dict[str, Any]:
    views = [{"camera": camera_json(h), "image": {"jpeg_base64": picture_base64(shade=100 + h)}} for h in headings]
    return {"object": "green flower pot", "views": views, **more}


def direction_body(labels: str = "abcde", **more: Any) -> dict[str, Any]:
    points = [{"label": label, "x": (i + 1) / 6, "y": 0.5, "distance_m": 2.0 + i} for i, label in enumerate(labels)]
    image = {"jpeg_base64": picture_base64()}
    return {"camera": camera_json(45), "image": image, "points": points, "task": "find the pot", **more}


def chat_settings(mock: OpenAiMock | None, **changes: Any) -> ChatModel:
    """A chat model at the mock, called `m` and of the preset `gpt-4o` unless changed;
    without a mock, at a port nobody listens on. Its limits are so wide that a machine which stands still for some
    seconds meets none of them: a test that wants to see one sets it."""
    values: dict[str, Any] = {
        "backend": "chat",
        "base_url": mock.url if mock else f"http://127.0.0.1:{closed_port()}/v1",
        "model": "maker/model-1",
        "preset": "gpt-4o",
        "timeout_s": 60.0,
        "connect_timeout_s": 30.0,
    }
    alias = str(changes.pop("alias", "m"))
    return chat_model(alias, ChatModelConfig.model_validate(values | changes), "test.toml")


def chat_backend(mock: OpenAiMock | None, *, key: str | None = None, **changes: Any) -> ChatBackend:
    model = chat_settings(mock, **changes)
    return ChatBackend(model, Upstream(model, key, lambda _: None))


class Built(NamedTuple):
    app: Frontend
    gateway: Gateway


def build(
    backends: Mapping[str, Backend],
    *,
    cache: Cache | None = None,
    mode: Mode = "on",
    roles: Mapping[str, str] | None = None,
    usage: UsageStore | None = None,
    prices: Mapping[str, Price] | None = None,
    **app: Any,
) -> Built:
    """An app whose roles are all played by the first back end unless `roles` says otherwise."""
    http = HttpMetrics()
    figures = GatewayMetrics(http.registry)
    guarded = None if cache is None else GuardedCache(cache, mode, figures.cache_failed, probe_every_s=0.1)
    first = next(iter(backends))
    played: Any = roles or dict.fromkeys(("floors", "recognition", "choice"), first)
    ledger = Ledger(usage or SqliteUsage(None, uuid.uuid4().hex), figures.usage_failed)
    gateway = Gateway(backends, played, guarded, figures, Accounts(ledger, prices or {}, figures))
    return Built(build_app(gateway, http, **app), gateway)


def sqlite_cache(folder: Path, name: str = "answers.sqlite") -> SqliteCache:
    return SqliteCache(folder / name, ttl_s=0, max_bytes=50_000_000)


def closed_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def post(url: str, path: str, body: Any, **more: Any) -> httpx.Response:
    return httpx.post(url + path, json=body, timeout=60, **more)


def wait_until(true: Callable[[], bool], within_s: float = 60.0) -> None:
    """Returns once it is; fails where it never is."""
    give_up = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < give_up, "it never happened"
        time.sleep(0.01)


def rows(path: Path) -> int:
    """How many answers an SQLite cache holds."""
    with contextlib.closing(sqlite3.connect(path)) as db:
        return int(db.execute("SELECT count(*) FROM answers").fetchone()[0])


def metric(url: str, name: str, **labels: str) -> float:
    """The sum of a metric's samples with these labels, off the service's own page."""
    total = 0.0
    for line in httpx.get(url + "/metrics", timeout=60).text.splitlines():
        if line.startswith(name + "{") and all(f'{key}="{value}"' in line for key, value in labels.items()):
            total += float(line.rsplit(" ", 1)[1])
    return total

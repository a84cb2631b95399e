"""One of the servers behind a model's alias: its connections, how busy and how quick it is, whether it may be asked."""

import math
import ssl
import time
from collections.abc import Callable, Sequence
from urllib.parse import urlencode, urlsplit

from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.model_configs import ServerConfig
from services.vlm_gateway.tracking import request_id
from services.vlm_gateway.upstream.health import ServerHealth
from services.vlm_gateway.upstream.http_reply import Buffer
from services.vlm_gateway.upstream.pool import Pool, Server

NEWEST_COUNTS = 0.2
"""The share of the newest answer in the latency."""
FORGOTTEN_AFTER_S = 30.0
"""A latency counts for less the longer the server was not asked, so that a slow one is tried again."""
LEAST_RAMP = 0.1
LONGEST_BUSY_S = 30.0


class Endpoint:
    """`running` are the calls under way; `unwell` says why the last health check failed, empty where it did not.
    `latency_s` is a moving average of the time to an answer, or to a stream's first words; 0 where none is known."""

    def __init__(
        self, server: ServerConfig, model: ChatModel, key: str | None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        config = model.config
        self.url = server.url
        self.weight = server.weight
        self.canary = server.canary
        self.health = ServerHealth()
        self.running = 0
        self.asked = 0
        self.latency_s = 0.0
        self.unwell = ""
        self.failed_in_a_row = 0
        self._busy_until = -math.inf
        self._clock = clock
        self._last_at = clock()
        self._joined_at = -math.inf
        self._slow_start_s = config.slow_start_s
        url = urlsplit(server.url)
        secure = url.scheme == "https"
        host, port = url.hostname or "", url.port or (443 if secure else 80)
        self.pool = Pool(
            Server(host, port, ssl.create_default_context() if secure else None),
            connect_timeout_s=config.connect_timeout_s,
            resend_unanswered=config.resend_unanswered,
        )
        self._prefix = url.path
        self._query = ("?" + urlencode(config.query)) if config.query else ""
        lines = [f"host: {url.netloc}", "content-type: application/json", "user-agent: logisticsvln"]
        if key:
            lines.append(
                f"{config.key_header}: {'Bearer ' if config.key_header.lower() == 'authorization' else ''}{key}"
            )
        lines += [f"{name}: {value}" for name, value in config.headers.items()]
        self._lines = "\r\n".join(lines).encode("latin-1")

    def request(
        self, route: str, body: Sequence[Buffer], trace: bytes | None, *, at_root: bool = False
    ) -> list[Buffer]:
        """A POST to a route under the server's address, or from its root."""
        path = (route if at_root else self._prefix + route) + self._query
        head = b"POST %s HTTP/1.1\r\n%s\r\ncontent-length: %d" % (path.encode(), self._lines, sum(map(len, body)))
        if trace is not None:
            head += b"\r\ntraceparent: " + trace
        if asked_by := request_id.get():
            head += b"\r\nx-request-id: " + asked_by
        return [head + b"\r\n\r\n", *body]

    def get(self, route: str) -> list[Buffer]:
        path = self._prefix + route + self._query
        return [b"GET %s HTTP/1.1\r\n%s\r\n\r\n" % (path.encode(), self._lines)]

    @property
    def drained(self) -> bool:
        """It gets no further calls; those under way go on."""
        return self.weight == 0.0 and self.canary == 0.0

    @property
    def ramp(self) -> float:
        """The share of its weight that counts, 0..1: little at first after it has come back."""
        if self._slow_start_s <= 0.0:
            return 1.0
        return min(1.0, max(LEAST_RAMP, (self._clock() - self._joined_at) / self._slow_start_s))

    def expected_latency_s(self) -> float:
        """What is known of it by now, fading."""
        return self.latency_s * math.exp(-(self._clock() - self._last_at) / FORGOTTEN_AFTER_S)

    def begin(self) -> None:
        """A call to it starts; `end` follows."""
        self.running += 1
        self.asked += 1

    def end(self) -> None:
        self.running -= 1

    def answered(self, took_s: float) -> None:
        """It has answered, or a stream has begun."""
        self.failed_in_a_row = 0
        newest = NEWEST_COUNTS if self.latency_s else 1.0
        self.latency_s += newest * (took_s - self.latency_s)
        self._last_at = self._clock()

    def failed(self, busy_s: float = 0.0) -> None:
        """It has not; where it said for how long it is busy, it is left alone until then."""
        self.failed_in_a_row += 1
        if busy_s:
            self._busy_until = self._clock() + min(busy_s, LONGEST_BUSY_S)

    @property
    def is_busy(self) -> bool:
        """As it said itself (429 or 503 with Retry-After)."""
        return self._clock() < self._busy_until

    def checked(self, problem: str) -> None:
        """A health check ended; `problem` is empty where it is well."""
        if self.unwell and not problem:
            self._joined_at = self._clock()
        self.unwell = problem

    def status(self) -> dict[str, object]:
        state = (
            "drained" if self.drained else "unwell" if self.unwell else "busy" if self.is_busy else self.health.state
        )
        return {
            "url": self.url,
            "weight": self.weight,
            "canary": self.canary,
            "running": self.running,
            "asked": self.asked,
            "latency_ms": round(self.latency_s * 1000, 1),
            "state": state,
            "problem": self.unwell,
        }

"""Who may ask, and how much: API keys by their hashes, with budgets of requests, places and tokens.

    python -m services.vlm_gateway.keys NAME     makes a key, and prints it with the lines for the configuration

A budget counts in this process, and what was spent is known only afterwards: a key is refused while it is in debt.
"""

import contextvars
import hashlib
import hmac
import math
import secrets
import sys
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from contracts.base import Wire
from service_kit.errors import ServiceError
from services.vlm_gateway.config import KeyConfig

DAY_S = 86_400.0
_PREFIX = "sk-lvln-"


class Unauthorised(ServiceError):
    """No key, or none that is known; which of the two is not told."""

    status = 401
    code = "unauthorised"


class Forbidden(ServiceError):
    """A key that may not do this."""

    status = 403
    code = "forbidden"


class OverBudget(ServiceError):
    """`code` says which budget: `rate_limited`, `too_many_at_once`, `tokens_spent`."""

    status = 429

    def __init__(self, message: str, *, code: str, wait_s: float, key: str) -> None:
        seconds = max(1, math.ceil(min(wait_s, DAY_S)))
        super().__init__(message, code=code, details={"key": key}, headers={"Retry-After": str(seconds)})


class _Bucket:
    """Fills steadily up to a minute's worth; may be overdrawn."""

    def __init__(self, per_minute: int, now: float) -> None:
        self._per_s = per_minute / 60.0
        self._size = float(per_minute)
        self.level = self._size
        self._at = now

    def fill(self, now: float) -> float:
        self.level = min(self._size, self.level + (now - self._at) * self._per_s)
        self._at = now
        return self.level

    def wait_s(self, amount: float) -> float:
        """Until there is `amount` in it."""
        return (amount - self.level) / self._per_s


class Key:
    """One caller. `enter` before its request is served, `leave` after; `spend` what its answers cost."""

    def __init__(self, name: str, config: KeyConfig | None, clock: Callable[[], float] = time.time) -> None:
        self.name = name
        self.tenant = (config.tenant or name) if config else ""
        self.models = None if config is None or config.models is None else frozenset(config.models)
        self.admin = config is None or config.admin
        self.running = 0
        self.spent_today = 0
        self._config = config
        self._clock = clock
        self._day = 0
        now = clock()
        requests, tokens = (config.requests_per_minute, config.tokens_per_minute) if config else (None, None)
        self._requests = _Bucket(requests, now) if requests else None
        self._tokens = _Bucket(tokens, now) if tokens else None

    def enter(self) -> None:
        """Raises OverBudget, with the time to wait."""
        config = self._config
        if config is not None:
            self._check(config)
        self.running += 1

    def leave(self) -> None:
        self.running -= 1

    def spend(self, tokens: int) -> None:
        """Prompt and completion together."""
        if self._tokens is not None:
            self._tokens.level -= tokens
        self._turn_day(self._clock())
        self.spent_today += tokens

    def may_ask(self, alias: str) -> bool:
        return self.models is None or alias in self.models

    def _check(self, config: KeyConfig) -> None:
        now = self._clock()
        if config.concurrency is not None and self.running >= config.concurrency:
            what = f"this key has {self.running} requests under way, which is all it may have at a time"
            raise OverBudget(what, code="too_many_at_once", wait_s=1.0, key=self.name)
        if self._tokens is not None and self._tokens.fill(now) <= 0:
            what = f"this key has spent its {config.tokens_per_minute} tokens a minute"
            raise OverBudget(what, code="tokens_spent", wait_s=self._tokens.wait_s(0.0), key=self.name)
        if config.tokens_per_day is not None:
            self._turn_day(now)
            if self.spent_today >= config.tokens_per_day:
                what = f"this key has spent its {config.tokens_per_day} tokens of today (UTC)"
                raise OverBudget(what, code="tokens_spent", wait_s=DAY_S - now % DAY_S, key=self.name)
        if self._requests is not None:
            if self._requests.fill(now) < 1.0:
                what = f"this key has made its {config.requests_per_minute} requests a minute"
                raise OverBudget(what, code="rate_limited", wait_s=self._requests.wait_s(1.0), key=self.name)
            self._requests.level -= 1.0

    def _turn_day(self, now: float) -> None:
        day = int(now // DAY_S)
        if day != self._day:
            self._day, self.spent_today = day, 0


ANYBODY = Key("", None)
"""Who asks where no keys are configured."""

asking: contextvars.ContextVar[Key] = contextvars.ContextVar("asking", default=ANYBODY)
"""Whose request is being served, for what is spent deep inside a typed question."""


class _Hashed(NamedTuple):
    digest: bytes
    key: Key


class Keys:
    """All keys by hash. `token` is the operator's own, which may do everything."""

    def __init__(self, configured: Mapping[str, KeyConfig], token: str | None = None) -> None:
        hashed = [_Hashed(bytes.fromhex(config.sha256), Key(name, config)) for name, config in configured.items()]
        if token is not None:
            hashed.append(_Hashed(hashlib.sha256(token.encode()).digest(), Key("operator", None)))
        self._by_hash = {one.digest: one for one in hashed}
        self.all = tuple(one.key for one in hashed)

    def of(self, authorization: bytes | None) -> Key:
        """The caller of a request with this header. Raises Unauthorised."""
        if not self._by_hash:
            return ANYBODY
        given = authorization or b""
        if given[:7].lower() == b"bearer ":
            digest = hashlib.sha256(given[7:].strip()).digest()
            # what a look-up's timing may tell of a hash leads nobody to the key behind it; the hash itself is then
            # compared in constant time
            known = self._by_hash.get(digest)
            if known is not None and hmac.compare_digest(known.digest, digest):
                return known.key
        way = {"www-authenticate": "Bearer"}
        raise Unauthorised("send a key of this gateway as 'Authorization: Bearer <key>'", headers=way)


class NewKey(Wire):
    """A key and what to keep of it."""

    key: str
    sha256: str


def new_key() -> NewKey:
    """256 bits of chance: what lets a plain hash be kept of it."""
    key = _PREFIX + secrets.token_urlsafe(32)
    return NewKey(key=key, sha256=hashlib.sha256(key.encode()).hexdigest())


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit("usage: python -m services.vlm_gateway.keys NAME")
    made = new_key()
    sys.stdout.write(f'the key, shown this once: {made.key}\n\n[keys.{sys.argv[1]}]\nsha256 = "{made.sha256}"\n')

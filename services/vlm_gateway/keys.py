"""Who may ask, and how much: API keys by their hashes, with budgets of requests, places and tokens.

    python -m services.vlm_gateway.keys NAME     makes a key, and prints it with the lines for the configuration

Rates (by minute) and places count in this process, or over all workers of it; budgets by day and month are the package
`usage`'s.
"""

import contextvars
import hashlib
import hmac
import secrets
import sys
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from contracts.base import Wire
from contracts.health import Access
from service_kit.errors import ServiceError
from service_kit.workers import Worker
from services.vlm_gateway.config import KeyConfig
from services.vlm_gateway.shared_limits import SharedBucket, SharedPlaces
from services.vlm_gateway.usage.budgets import BudgetConfig, OverBudget, Spender

_PREFIX = "sk-lvln-"
_RATE = "x-ratelimit-limit-{0}: {1}\r\nx-ratelimit-remaining-{0}: %d\r\nx-ratelimit-reset-{0}: %.3fs\r\n"


class Unauthorised(ServiceError):
    """No key, or none that is known; which of the two is not told."""

    status = 401
    code = "unauthorised"


class Forbidden(ServiceError):
    """A key that may not do this."""

    status = 403
    code = "forbidden"


class Bucket:
    """Fills steadily up to a minute's worth; may be overdrawn."""

    def __init__(self, per_minute: int, now: float) -> None:
        self.per_s = per_minute / 60.0
        self.size = float(per_minute)
        self.level = self.size
        self._at = now

    def add(self, amount: float) -> None:
        """Negative where it is spent."""
        self.level += amount

    def spend(self, amount: float, least: float, now: float) -> bool:
        """Whether there was something in it, and `least` at least; then `amount` is spent."""
        self.level = level = min(self.size, self.level + (now - self._at) * self.per_s)
        self._at = now
        if level <= 0.0 or level < least:
            return False
        self.level = level - amount
        return True

    def wait_s(self, amount: float) -> float:
        """Until there is `amount` in it."""
        return (amount - self.level) / self.per_s


class Key:
    """One caller. `enter` before its request is served, `leave` after; `hold` what a call to a model may use before it
    is made, `settle` what it did use. `team` are the budgets of the key's team."""

    def __init__(
        self,
        name: str,
        config: KeyConfig | None,
        team: BudgetConfig | None = None,
        clock: Callable[[], float] = time.time,
        worker: Worker | None = None,
    ) -> None:
        self.name = name
        self.tenant = (config.tenant or name) if config else ""
        self.models = None if config is None or config.models is None else frozenset(config.models)
        self.admin = config is None or config.admin
        self.running = 0
        self.team = config.team if config else None
        self.spender = _spender(name, config, team)
        self.config = config
        self._clock = clock
        self._held = 0
        now = clock()
        requests, tokens = (config.requests_per_minute, config.tokens_per_minute) if config else (None, None)
        self._requests = _bucket(worker, f"key {name} requests {requests}", requests, now) if requests else None
        self._tokens = _bucket(worker, f"key {name} tokens {tokens}", tokens, now) if tokens else None
        self._requests_lines = _RATE.format("requests", requests).encode()
        self._tokens_lines = _RATE.format("tokens", tokens).encode()
        places = config.concurrency if config else None
        self._places = SharedPlaces(worker, f"key {name} places", places) if worker is not None and places else None

    def enter(self) -> None:
        """Raises OverBudget, with the time to wait."""
        config = self.config
        if config is not None:
            self._check(config)
        self.running += 1

    def leave(self) -> None:
        self.running -= 1
        if self._places is not None:
            self._places.give_back()

    def hold(self, tokens: int) -> None:
        """Room for so many in this minute's tokens. Raises OverBudget, with the time to wait; a call that is larger
        than what is left is let through where no other is under way."""
        least = tokens if self._held else 0
        if self._tokens is not None and not self._tokens.spend(tokens, least, self._clock()):
            assert self.config is not None
            what = f"this key's {self.config.tokens_per_minute} tokens a minute are spent or held by calls under way"
            wait_s = self._tokens.wait_s(max(0.0, min(tokens, self._tokens.size)))
            raise OverBudget(what, code="tokens_spent", wait_s=wait_s, key=self.name)
        self._held += tokens

    def settle(self, held: int, used: int) -> None:
        """A call that held so many has used so many."""
        self._held -= held
        if self._tokens is not None:
            self._tokens.add(held - used)

    def rates(self) -> bytes:
        """Header lines with what was left of this minute's requests and tokens when they were last counted, as OpenAI
        tells it; empty where nothing bounds them."""
        lines = b"" if self._requests is None else _told(self._requests_lines, self._requests)
        return lines if self._tokens is None else lines + _told(self._tokens_lines, self._tokens)

    def may_ask(self, alias: str) -> bool:
        return self.models is None or alias in self.models

    def _check(self, config: KeyConfig) -> None:
        full = self.running >= config.concurrency if config.concurrency is not None else False
        if not self._places.take() if self._places is not None else full:
            what = f"this key has {config.concurrency} requests under way, which is all it may have at a time"
            raise OverBudget(what, code="too_many_at_once", wait_s=1.0, key=self.name)
        if self._requests is not None and not self._requests.spend(1.0, 1.0, self._clock()):
            if self._places is not None:
                self._places.give_back()
            what = f"this key has made its {config.requests_per_minute} requests a minute"
            raise OverBudget(what, code="rate_limited", wait_s=self._requests.wait_s(1.0), key=self.name)


def _bucket(worker: Worker | None, name: str, per_minute: int, now: float) -> Bucket | SharedBucket:
    """One for all workers, where there are several."""
    return Bucket(per_minute, now) if worker is None else SharedBucket(worker, name, per_minute, now)


def _told(lines: bytes, bucket: "Bucket | SharedBucket") -> bytes:
    """The header lines of one rate."""
    level = bucket.level
    return lines % (level if level > 0.0 else 0.0, (bucket.size - level) / bucket.per_s)


def _spender(name: str, config: KeyConfig | None, team: BudgetConfig | None) -> Spender:
    owner = f"key:{name}"
    if config is None:
        return Spender(name, (owner,), ())
    budgets = config.budgets(owner)
    if config.team is None:
        return Spender(name, (owner,), budgets)
    teams_owner = f"team:{config.team}"
    return Spender(name, (owner, teams_owner), budgets + (team.budgets(teams_owner) if team else ()))


ANYBODY = Key("", None)
"""Who asks where no keys are configured."""

asking: contextvars.ContextVar[Key] = contextvars.ContextVar("asking", default=ANYBODY)
"""Whose request is being served, for what is spent deep inside a typed question."""


class _Hashed(NamedTuple):
    digest: bytes
    key: Key


class Keys:
    """All keys by hash. `token` is the operator's own, which may do everything."""

    def __init__(
        self,
        configured: Mapping[str, KeyConfig],
        token: str | None = None,
        teams: Mapping[str, BudgetConfig] | None = None,
        worker: Worker | None = None,
    ) -> None:
        self.teams = dict(teams or {})
        hashed = [
            _Hashed(bytes.fromhex(config.sha256), Key(name, config, self.teams.get(config.team or ""), worker=worker))
            for name, config in configured.items()
        ]
        if token is not None:
            hashed.append(_Hashed(hashlib.sha256(token.encode()).digest(), Key("operator", None)))
        self._by_hash = {one.digest: one for one in hashed}
        self.all = tuple(one.key for one in hashed)

    def adopt(self, new: "Keys") -> None:
        """From now on these are the keys. One that is as it was goes on as it is, with what it has under way."""
        kept = {(key.name, key.config, key.spender): key for key in self.all}
        hashed = [
            one._replace(key=kept.get((one.key.name, one.key.config, one.key.spender), one.key))
            for one in new._by_hash.values()
        ]
        self._by_hash = {one.digest: one for one in hashed}
        self.all = tuple(one.key for one in hashed)
        self.teams = new.teams

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

    def access(self, authorization: bytes | None) -> Access:
        """What such a header is worth."""
        try:
            key = self.of(authorization)
        except Unauthorised:
            return "wrong_token" if authorization else "missing_token"
        return "open" if key is ANYBODY else "granted"


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

"""How one service calls another: typed in, typed out, always with a deadline.

CallError
  Unreachable     nobody answered, or not in time
    TimedOut      not in time
  Refused         the service answered with an error: its status, code and message
  Garbled         the service answered something that is not its contract
"""

import json
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, NamedTuple, Self, TypeVar

import aiohttp
from pydantic import BaseModel, ValidationError

from contracts.errors import STOPPING, ErrorBody, first_problem
from contracts.health import Health
from service_kit.connections import TOKEN_VARIABLES
from service_kit.settings import without_password

M = TypeVar("M", bound=BaseModel)


class CallError(Exception):
    """A call to a service that brought no answer of its contract."""

    def __init__(self, service: str, message: str) -> None:
        super().__init__(f"{service}: {message}")
        self.service = service
        self.message = message


class Unreachable(CallError):
    """Nobody answered, or not in time."""


class TimedOut(Unreachable):
    """No answer within the deadline."""


class Garbled(CallError):
    """An answer that is not of the contract."""


class Refused(CallError):
    """The service's own error."""

    def __init__(self, service: str, status: int, code: str, message: str, details: dict[str, Any]) -> None:
        super().__init__(service, f"{message} ({status} {code})")
        self.status = status
        self.code = code
        self.reason = message
        self.details = details


class _Said(NamedTuple):
    """An answer as it came."""

    status: int
    body: bytes
    headers: Mapping[str, str]


class ServiceClient:
    """One service at one address. Use as an async context manager, or `close` it."""

    def __init__(self, service: str, url: str, *, timeout_s: float = 30.0, token: str | None = None) -> None:
        self._service = service
        self._url = url.rstrip("/")
        self._timeout_s = timeout_s
        self._headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._session: aiohttp.ClientSession | None = None

    @property
    def service(self) -> str:
        return self._service

    @property
    def url(self) -> str:
        """The address without credentials, fit to be shown."""
        return without_password(self._url)

    async def call(
        self,
        method: str,
        path: str,
        answer: type[M],
        question: BaseModel | None = None,
        *,
        params: dict[str, str] | None = None,
        headers: dict[str, str] | None = None,
        timeout_s: float | None = None,
        hear: Callable[[Mapping[str, str]], None] | None = None,
    ) -> M:
        """One call; it may take `timeout_s`. `hear` is told the answer's headers.

        Raises Unreachable, Refused or Garbled; never another error of the network's."""
        body = None if question is None else question.model_dump_json().encode()
        within_s = timeout_s or self._timeout_s
        status, data, told = await self._exchange(method, path, body, params, within_s, headers)
        if status >= 400:
            raise self._refused(status, data)
        if hear is not None:
            hear(told)
        try:
            return answer.model_validate_json(data)
        except ValidationError as error:
            else_than = f"answered {method} {path} with something else than {answer.__name__}"
            raise Garbled(self._service, f"{else_than}: {first_problem(error)}") from None

    async def delete(self, path: str) -> None:
        """DELETE, with nothing in return. Raises Unreachable or Refused."""
        status, data, _ = await self._exchange("DELETE", path, None, None, self._timeout_s)
        if status >= 400:
            raise self._refused(status, data)

    async def ready(self, timeout_s: float = 2.0) -> str | None:
        """Null when `/readyz` says so, else what is wrong."""
        found = await self._health(timeout_s)
        return found if isinstance(found, str) else None

    async def usable(self, timeout_s: float = 2.0) -> str | None:
        """Null when the service is ready and accepts our token, else what is wrong and what to do."""
        health = await self._health(timeout_s)
        return health if isinstance(health, str) else self._token_problem(health)

    async def token_problem(self, timeout_s: float = 2.0) -> str | None:
        """What is wrong with our token and what to do; null where it is right, and where nobody answers."""
        health = await self._health(timeout_s)
        return None if isinstance(health, str) else self._token_problem(health)

    def _token_problem(self, health: Health) -> str | None:
        variable = TOKEN_VARIABLES.get(self._service, "its token")
        if health.access == "missing_token":
            return f"asks for a token; set {variable} or {variable}_FILE here to the one it was started with"
        if health.access == "wrong_token":
            return f"refuses the token of {variable}; set it here to the one that the service was started with"
        return None

    async def _health(self, timeout_s: float) -> Health | str:
        """What the service says of itself, or what is wrong."""
        try:
            return await self.call("GET", "/readyz", Health, timeout_s=timeout_s)
        except Refused as error:
            return error.reason
        except CallError as error:
            return error.message

    async def close(self) -> None:
        if self._session is not None:
            await self._session.close()
            self._session = None

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def _exchange(
        self,
        method: str,
        path: str,
        body: bytes | None,
        params: dict[str, str] | None,
        timeout_s: float,
        more_headers: dict[str, str] | None = None,
    ) -> _Said:
        if self._session is None:
            self._session = aiohttp.ClientSession(headers=self._headers, trust_env=False)
        headers = dict(more_headers or {}) | ({"Content-Type": "application/json"} if body is not None else {})
        limit = aiohttp.ClientTimeout(total=timeout_s)
        try:
            async with self._session.request(
                method, self._url + path, data=body, params=params, headers=headers, timeout=limit
            ) as response:
                status, data = response.status, await response.read()
        except TimeoutError:
            raise TimedOut(self._service, f"no answer from {self.url} within {timeout_s:g} s") from None
        except (aiohttp.ClientError, OSError) as error:
            raise Unreachable(self._service, f"can't reach {self.url} ({type(error).__name__})") from None
        if status == 503 and self._refused(status, data).code == STOPPING:
            raise Unreachable(self._service, f"{self.url} is stopping")
        return _Said(status, data, response.headers)

    def _refused(self, status: int, data: bytes) -> Refused:
        try:
            error = ErrorBody.model_validate(json.loads(data)).error
        except (ValueError, ValidationError):
            return Refused(self._service, status, "http_error", "answered an error without our error body", {})
        return Refused(self._service, status, error.code, error.message, error.details)

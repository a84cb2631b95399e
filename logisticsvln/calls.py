"""What an orchestrator is asked over HTTP, and how its answers are read: shared by the two clients, which only send."""

import re
import time
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any, Generic, NamedTuple, TypeVar
from uuid import uuid4

import httpx
from pydantic import BaseModel, TypeAdapter, ValidationError

from contracts.errors import ErrorBody, first_problem
from contracts.events import Event, read_event
from contracts.fleet import FleetList
from contracts.health import Health
from contracts.orchestrator import (
    CustomerAnswer,
    Delivery,
    DeliveryList,
    DeliveryQuestion,
    DeliveryResult,
    DeliveryStatus,
    OpenQuestion,
)
from service_kit.addresses import PORTS
from service_kit.client import CallError, Garbled, Refused, TimedOut, Unreachable
from service_kit.settings import process_environment, secret, without_password

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)
SERVICE = "orchestrator"
USUAL_URL = f"http://127.0.0.1:{PORTS[SERVICE]}"
EVENTS_PAUSE_S = 0.5
"""Before a stream of events that broke off is asked for again."""
LONGEST_PAUSE_S = 1.0
"""Between two looks at a delivery that is waited for."""


class Call(NamedTuple, Generic[T]):
    """One request and how its answer is read: `read` is given the body, and raises ValueError for what is none."""

    method: str
    path: str
    read: Callable[[bytes], T]
    body: BaseModel | None = None
    params: Mapping[str, str] | None = None
    headers: Mapping[str, str] | None = None

    def request(self) -> dict[str, Any]:
        """As httpx takes it."""
        sent: dict[str, Any] = {"method": self.method, "url": self.path, "params": dict(self.params or {})}
        headers = dict(self.headers or {})
        if self.body is not None:
            sent["content"] = self.body.model_dump_json()
            headers["content-type"] = "application/json"
        return sent | {"headers": headers}


def told(model: type[M]) -> Callable[[bytes], M]:
    """Reads an answer of that type; fields that only a newer service knows are passed over."""
    return lambda body: model.model_validate_json(body, extra="ignore")


def connection(url: str | None, token: str | None, timeout_s: float) -> dict[str, Any]:
    """What both of httpx's clients are made with. The token is ORCHESTRATOR_TOKEN's where none is given. Raises
    ValueError for what is no address or no token."""
    base = (url or USUAL_URL).rstrip("/")
    try:
        parsed = httpx.URL(base)
    except httpx.InvalidURL as error:
        raise ValueError(f"url: {base!r} is none ({error}); it is one such as {USUAL_URL}") from None
    if parsed.scheme not in ("http", "https") or not parsed.host or (parsed.port or 1) > 65_535:
        raise ValueError(
            f"url: {base!r} needs http:// or https://, a host, and a port that there is, as {USUAL_URL} has"
        )
    token = token or secret(process_environment(), "ORCHESTRATOR_TOKEN")
    if token and not _fits_header(token):
        raise ValueError("token: it has letters that no header of HTTP may have, a line's end perhaps")
    headers = {"authorization": f"Bearer {token}"} if token else {}
    return {"base_url": base, "headers": headers, "timeout": timeout_s, "trust_env": False}


def _fits_header(text: str) -> bool:
    return text.isascii() and text.isprintable()


def question_of(**asked: Any) -> DeliveryQuestion:
    """Raises ValueError for what can't be a delivery."""
    try:
        return DeliveryQuestion(**asked)
    except ValidationError as error:
        raise ValueError(first_problem(error)) from None


def post_delivery(question: DeliveryQuestion, key: str | None) -> Call[Delivery]:
    """A delivery; without a key it gets one of its own, so that sending it again is no second delivery. Raises
    ValueError for a key that no header may hold."""
    if key is not None and not _fits_header(key):
        raise ValueError(f"key: {key!r} has other letters than those of ASCII")
    headers = {"idempotency-key": key or uuid4().hex}
    return Call("POST", "/v1/deliveries", told(Delivery), question, headers=headers)


def _path(delivery: str, *parts: str) -> str:
    """Raises ValueError for what is no id of a delivery, or no name of a file."""
    for part in (delivery, *parts):
        if not isinstance(part, str) or re.fullmatch(r"\w[\w.:+-]*", part, re.ASCII) is None:
            raise ValueError(f"{part!r} is neither a delivery's id nor the name of one of its files")
    return "/".join(("/v1/deliveries", delivery, *parts))


def get_delivery(delivery: str) -> Call[Delivery]:
    return Call("GET", _path(delivery), told(Delivery))


def delete_delivery(delivery: str) -> Call[Delivery]:
    return Call("DELETE", _path(delivery), told(Delivery))


def post_answer(delivery: str, text: str) -> Call[Delivery]:
    path = _path(delivery, "answer")
    return Call("POST", path, told(Delivery), CustomerAnswer(text=text))


def list_deliveries(
    status: DeliveryStatus | None, since: datetime | None, text: str | None, before: str | None, limit: int
) -> Call[DeliveryList]:
    """A page. `since` needs a time zone: ValueError without one."""
    if since is not None and (not isinstance(since, datetime) or since.tzinfo is None):
        raise ValueError("since: give a time with its time zone, such as datetime.now(timezone.utc)")
    asked = {
        "status": status,
        "since": None if since is None else since.isoformat(),
        "text": text,
        "before": before,
        "limit": str(limit),
    }
    params = {name: value for name, value in asked.items() if value is not None}
    return Call("GET", "/v1/deliveries", told(DeliveryList), params=params)


def get_file(delivery: str, file: str) -> Call[bytes]:
    return Call("GET", _path(delivery, "files", file), bytes)


def list_vehicles() -> Call[FleetList]:
    return Call("GET", "/v1/vehicles", told(FleetList))


def list_samples() -> Call[list[str]]:
    return Call("GET", "/v1/samples", TypeAdapter(list[str]).validate_json)


def get_health() -> Call[Health]:
    return Call("GET", "/readyz", told(Health))


def events_path(delivery: str) -> str:
    return _path(delivery, "events")


def answer_of(call: Call[T], response: httpx.Response, service: str = SERVICE) -> T:
    """Raises Refused, Garbled."""
    check(response.status_code, response.content, service)
    try:
        return call.read(response.content)
    except (ValidationError, ValueError) as error:
        said = first_problem(error) if isinstance(error, ValidationError) else str(error)
        raise Garbled(service, f"answered {call.method} {call.path} with something else: {said}") from None


def check(status: int, body: bytes, service: str = SERVICE) -> None:
    """Raises Refused for an answer that is an error."""
    if status < 400:
        return
    try:
        said = ErrorBody.model_validate_json(body).error
    except ValidationError:
        raise Refused(service, status, "http_error", "answered an error without our error body", {}) from None
    raise Refused(service, status, said.code, said.message, said.details)


def unreachable(url: object, error: httpx.RequestError, service: str = SERVICE) -> CallError:
    """The client's error as ours."""
    shown = without_password(str(url))
    if isinstance(error, httpx.DecodingError):
        return Garbled(service, f"answered something that can't be unpacked ({error})")
    if isinstance(error, httpx.TimeoutException):
        return TimedOut(service, f"no answer from {shown} in time")
    return Unreachable(service, f"can't reach {shown} ({type(error).__name__}: {error})")


class Listening:
    """A delivery's events as they arrive, over as many connections as it takes: none is told twice, none left out."""

    def __init__(self, after: int, patience_s: float) -> None:
        self._after = after
        self._patience_s = patience_s
        self._heard = time.monotonic()
        self.over = False

    def headers(self) -> dict[str, str]:
        return {"last-event-id": str(self._after), "accept": "text/event-stream"}

    def take(self, kind: str, data: str) -> Event | None:
        """The event of a message, where it is a new one. Raises Garbled."""
        self._heard = time.monotonic()
        if kind == "end":
            self.over = True
            return None
        if not data:  # httpx-sse takes a comment, which is how the server shows that it lives, for a message
            return None
        try:
            event = read_event(data)
        except ValueError as error:
            raise Garbled(SERVICE, f"sent an event that is none: {error}") from None
        if event.number <= self._after:
            return None
        self._after = event.number
        self.over = event.kind == "result"
        return event

    def broke_off(self, error: CallError) -> None:
        """Raises the error where nothing was heard for too long: then it is no restart that passes."""
        if time.monotonic() > self._heard + self._patience_s:
            raise error from None


def is_passing(error: Refused) -> bool:
    """An answer of a service that starts, stops or is full."""
    return error.status in (429, 503)


class Waiting:
    """Until a delivery is done: how long, and which questions of it were put already."""

    def __init__(self, delivery: str, timeout_s: float | None, patience_s: float) -> None:
        self._delivery = delivery
        self._timeout_s = timeout_s
        self._patience_s = patience_s
        self._began = self._heard = time.monotonic()
        self._put: OpenQuestion | None = None

    def result_of(self, delivery: Delivery) -> DeliveryResult | None:
        """Null while it is not done."""
        self._heard = time.monotonic()
        return delivery.result if delivery.status == "done" else None

    def asked(self, delivery: Delivery) -> OpenQuestion | None:
        """A question that is open and was not put yet."""
        if delivery.question is None or delivery.question == self._put:
            return None
        self._put = delivery.question
        return delivery.question

    def missed(self, error: CallError) -> None:
        """An answer did not come. Raises the error where that is no restart that passes."""
        if isinstance(error, Refused) and not is_passing(error):
            raise error
        if time.monotonic() > self._heard + self._patience_s:
            raise error

    def pause_s(self) -> float:
        """Before the next look; longer the longer it takes. Raises TimeoutError."""
        waited_s = time.monotonic() - self._began
        if self._timeout_s is not None and waited_s >= self._timeout_s:
            raise TimeoutError(f"delivery {self._delivery} is not done after {self._timeout_s:g} s; it goes on")
        left_s = LONGEST_PAUSE_S if self._timeout_s is None else self._timeout_s - waited_s
        return max(0.01, min(LONGEST_PAUSE_S, 0.05 + waited_s / 20, left_s))

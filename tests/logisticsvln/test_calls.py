"""What can be no call to an orchestrator is told before anything is sent."""

from datetime import datetime
from typing import Any

import httpx
import pytest

from logisticsvln import AsyncClient, Client, Garbled
from logisticsvln.calls import unreachable


@pytest.mark.parametrize(
    "url", ["localhost:8100", "127.0.0.1", "http://", "ftp://host", "http://host:99999", "http://[::1"]
)
@pytest.mark.parametrize("client", [Client, AsyncClient])
def test_what_is_no_address_is_told_at_once_and_not_asked_for_a_minute(client: type, url: str) -> None:
    with pytest.raises(ValueError, match=r"^url: .*http://127\.0\.0\.1:8100"):
        client(url)


@pytest.mark.parametrize("token", ["two\nlines", "geheim-ü", "nul\0"])
def test_a_token_that_no_header_may_hold_is_told_and_not_shown(token: str) -> None:
    with pytest.raises(ValueError, match=r"^token: it has letters") as raised:
        Client(token=token)
    assert token not in str(raised.value)


@pytest.mark.parametrize(
    ("method", "arguments", "problem"),
    [
        ("delivery", [""], "'' is neither a delivery's id"),
        ("delivery", ["../samples"], "neither"),
        ("delivery", [None], "None is neither"),
        ("file", ["20260101-000000-abcdef", "../../etc/passwd"], "neither"),
        ("answer", ["a?b", "4"], "neither"),
        ("cancel", ["a b"], "neither"),
        ("deliver", ["a" * 5000], "^request: .*4000 characters"),
        ("deliver", [3], "^request: "),
    ],
)
def test_what_can_be_no_call_is_told_before_it_is_sent(method: str, arguments: list[Any], problem: str) -> None:
    with Client("http://127.0.0.1:1") as client, pytest.raises(ValueError, match=problem):
        getattr(client, method)(*arguments)


def test_a_key_or_a_time_that_cannot_be_sent_is_told() -> None:
    with Client("http://127.0.0.1:1") as client:
        with pytest.raises(ValueError, match=r"^key: "):
            client.deliver("floor 3, a kite", sample="street-kite", key="zwei\nZeilen")
        for since in ("yesterday", datetime(2026, 1, 1)):
            with pytest.raises(ValueError, match=r"^since: give a time with its time zone"):
                list(client.deliveries(since=since))  # type: ignore[arg-type]


def test_an_answer_that_cannot_be_unpacked_is_somebody_elses() -> None:
    assert isinstance(unreachable("http://host", httpx.DecodingError("incorrect header check")), Garbled)

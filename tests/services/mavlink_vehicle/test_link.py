"""Calls of MAVSDK that outlive whoever waits for them."""

import asyncio
import gc
import logging

import pytest
from mavsdk.plugins.action import ActionError, ActionResult

from services.mavlink_vehicle.link import Link
from services.mavlink_vehicle.telemetry import Telemetry


async def test_a_call_that_fails_after_its_waiter_is_gone_is_not_an_error_of_asyncio(
    caplog: pytest.LogCaptureFixture,
) -> None:
    answered = asyncio.Event()

    async def call() -> None:
        await answered.wait()
        raise ActionError(ActionResult.TIMEOUT, "arm()")

    link = Link("udpin://127.0.0.1:1", Telemetry())
    with caplog.at_level(logging.DEBUG):
        waiter = asyncio.create_task(link._called(call()))
        await asyncio.sleep(0)
        waiter.cancel()
        await asyncio.gather(waiter, return_exceptions=True)
        answered.set()
        for _ in range(5):
            await asyncio.sleep(0)
        gc.collect()
    assert [record.levelname for record in caplog.records if record.name == "asyncio"] in ([], ["DEBUG"])
    assert "a call of MAVSDK ended with" in caplog.text

"""Deliveries behind the flight guard, flown by the stand-in autopilot: whole, and with a fault each."""

from pathlib import Path

import pytest

from tests.autopilot.deliveries import FAULTS, SAMPLE, flown

pytestmark = pytest.mark.slow
NAMED = {
    "none": {"delivered"},
    "refuses to arm": {"service_unreachable"},
    "pilot takes over": {"stopped_by_guard"},
    "low battery": {"stopped_by_guard"},
    "link lost for good": {"service_unreachable"},
}


async def test_every_delivery_ends_by_name_with_the_drone_on_the_ground_or_holding(tmp_path: Path) -> None:
    faults = [fault for fault in FAULTS if fault.name in NAMED]
    for ended in await flown([SAMPLE] * len(faults), faults, "px4", tmp_path):
        assert ended.outcome in NAMED[ended.fault], ended
        assert ended.rests, ended
        assert not ended.collided, ended

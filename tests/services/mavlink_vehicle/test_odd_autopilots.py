"""What real autopilots do otherwise than the stand-in at its best: each flown through real MAVSDK and MAVLink."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from contracts.geometry import Point3
from contracts.vehicle import Move
from service_kit.client import ServiceClient
from tests.autopilot.stand_in import StandIn
from tests.services.mavlink_vehicle.conftest import standing

NEAR_M, BESIDE_M = 0.8, 1.3
Client = Callable[[str], ServiceClient]
pytestmark = pytest.mark.slow


class Odd(NamedTuple):
    """`more`: options that the stand-in starts with; `told`: before the take-off."""

    name: str
    more: tuple[str, ...] = ()
    told: tuple[str, dict[str, Any]] | None = None
    near_m: float = NEAR_M


ODD = (
    Odd("another system than 1, gimbal, camera and ground station beside it", ("--system", "7", "--company")),
    Odd("its place is not its frame's origin", ("--origin", "40", "-25", "-3")),
    Odd("its estimate takes its time", ("--ekf-s", "12")),
    Odd("its frame is set anew while it stands", told=("set_anew", {"m": [30.0, -20.0, 5.0]})),
    Odd("it arms only after a while", told=("refuses", {"s": 6.0})),
    Odd("its battery tells nothing", told=("faults", {"no_charge": True})),
    Odd("somebody slows its streams", told=("streams", {"hz": 4.0})),
    Odd("it rests a metre beside", told=("faults", {"off_m": [0.6, -0.6, 0.5]}), near_m=BESIDE_M),
)


@pytest.mark.parametrize("firmware", ["px4", "ardupilot"])
@pytest.mark.parametrize("odd", ODD, ids=lambda odd: odd.name)
async def test_it_takes_off_flies_and_lands_though(
    odd: Odd, firmware: str, stand_in: Callable[..., StandIn], behind: Callable[..., str], client: Client
) -> None:
    autopilot = stand_in(firmware, yaw=2.0, more=odd.more)
    vehicle = await standing(client(behind(autopilot)))
    if odd.told is not None:
        autopilot.told(odd.told[0], **odd.told[1])
    stood = (await vehicle.state()).pose
    risen = (await vehicle.take_off(2.0)).pose
    assert risen.z == pytest.approx(stood.z + 2.0, abs=odd.near_m)
    there = Point3(x=3.0, y=2.0, z=3.0)
    done = await vehicle.fly(1, Move(path=(there,)))
    assert done.reached
    assert math.dist((done.pose.x, done.pose.y, done.pose.z), (there.x, there.y, there.z)) < odd.near_m
    remaining = (await vehicle.state()).battery.remaining
    assert (remaining is None) == (odd.told is not None and "no_charge" in odd.told[1])
    assert (await vehicle.land()).mode == "landed"
    told = autopilot.told()
    assert (told["armed"], told["in_air"]) == (False, False)

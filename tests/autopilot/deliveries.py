"""`python -m tests.autopilot.deliveries`: deliveries flown by the stand-in autopilot, with faults on request.

The services and the autopilot are processes of this machine; missions run here, behind the flight guard. Each delivery
is one line: the fault, the outcome, where the vehicle ended, what it said. With `--faults` the sample is flown as often
as `--count` says, each time with the next of `FAULTS`; without it every sample once. Ends with code 1 where a delivery
ended without a named outcome, or with a vehicle that neither stands nor holds.
"""

import argparse
import asyncio
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from contracts.orchestrator import DeliveryQuestion
from contracts.vehicle import VehicleState
from launcher.processes import CannotStart, Processes, free_ports
from mission.clients import Services
from orchestrator import sample_library
from orchestrator.delivery import Order, Run
from service_kit.addresses import FLIGHT_SERVICES, Addresses
from service_kit.client import CallError, ServiceClient
from service_kit.settings import process_environment
from tests.autopilot.stand_in import StandIn

SAMPLE = "villa-teddy-bear"
RESTS_WITHIN_S, DOWN_WITHIN_S = 40.0, 150.0
UNDER_WAY = ("takeoff", "rtl", "land")
"""Modes that end in another place: who is in one does not rest, however slow."""
Told = tuple[str, dict[str, Any]]


class Fault(NamedTuple):
    """`told`: lines for the stand-in, given once the vehicle has flown `after_m` (0: before it takes off). `more`:
    options that it is started with."""

    name: str
    after_m: float
    told: tuple[Told, ...]
    more: tuple[str, ...] = ()


FAULTS: tuple[Fault, ...] = (
    Fault("none", 0.0, ()),
    Fault("refuses to arm", 0.0, (("faults", {"refuse_arming": True}),)),
    Fault("no GPS on the ground", 0.0, (("faults", {"no_gps": True}),)),
    Fault("no GPS in the air", 6.0, (("faults", {"no_gps": True}),)),
    Fault("pilot takes over", 8.0, (("pilot", {"mode": "position"}),)),
    Fault("failsafe returns", 10.0, (("pilot", {"mode": "rtl"}),)),
    Fault("low battery", 12.0, (("battery", {"left": 0.16}),)),
    Fault("link lost for 2 s", 7.0, (("silence", {"s": 2.0}),)),
    Fault("link lost for good", 9.0, (("silence", {"s": 3600.0}),)),
    Fault("estimate leaps by 5 m", 8.0, (("jump", {"m": [5.0, 0.0, 0.0]}),)),
    Fault("estimate creeps", 4.0, (("faults", {"creep_m_s": [0.1, 0.05, 0.0]}),)),
    Fault("wind of 1 m/s", 2.0, (("push", {"m_s": [0.7, 0.7, 0.0]}),)),
    Fault("estimate is slow", 0.0, (), ("--ekf-s", "25")),
    Fault("arms only after 15 s", 0.0, (("refuses", {"s": 15.0}),)),
    Fault("estimate is set anew on the ground", 0.0, (("set_anew", {"m": [30.0, -20.0, 5.0]}),)),
    Fault("rests a metre beside", 3.0, (("faults", {"off_m": [0.6, -0.6, 0.5]}),)),
    Fault("one of many on the link", 0.0, (), ("--system", "7", "--company", "--origin", "40", "-25", "-3")),
    Fault("battery that tells nothing", 0.0, (("faults", {"no_charge": True}),)),
    Fault("slow streams", 4.0, (("streams", {"hz": 4.0}),)),
    Fault("modes are refused", 6.0, (("faults", {"refuse": ["rtl", "land"]}),)),
)


class Ended(NamedTuple):
    """One delivery: `rests` says whether the vehicle stands or holds."""

    sample: str
    fault: str
    outcome: str
    message: str
    steps: int
    seconds: float
    collided: bool
    where: str
    rests: bool


class Field:
    """The services that fly nothing, with one autopilot and its vehicle at a time."""

    def __init__(self, folder: Path, firmware: str, at: Addresses) -> None:
        self._folder = folder
        self._firmware = firmware
        self._at = at

    async def fly(self, sample: str, fault: Fault, number: int) -> Ended:
        """One delivery with an autopilot of its own."""
        ports = free_ports(("mavlink_vehicle",))
        with StandIn(self._firmware, seed=number, yaw=0.3 * number, more=fault.more) as autopilot:
            autopilot.told()  # it is up
            extra = {"mavlink_vehicle": {"AUTOPILOT": autopilot.address, "SIM_URL": self._at.sim}}
            logs = self._folder / "logs"
            async with Processes(ports, logs, environment=process_environment(), extra=extra) as group:
                vehicle = group.children[0].url
                services = Services(replace(self._at, sim=vehicle))
                return await self._flown(sample, fault, services, autopilot, vehicle)

    async def _flown(self, sample: str, fault: Fault, services: Services, autopilot: StandIn, vehicle: str) -> Ended:
        began = time.monotonic()
        async with services, ServiceClient("mavlink_vehicle", vehicle, timeout_s=10.0) as client:
            run = Run(Order(DeliveryQuestion(sample=sample, backend="embedded")), self._folder / "runs")
            spoiling = asyncio.create_task(_spoil(autopilot, fault, client))
            result = await run.fly(services.simulated())
            spoiling.cancel()
            rests, where = await _rested(autopilot, client)
        collided = bool(result.verdict and result.verdict.collided) or result.outcome == "collision"
        seconds = time.monotonic() - began
        return Ended(sample, fault.name, result.outcome, result.message, result.steps, seconds, collided, where, rests)


async def _spoil(autopilot: StandIn, fault: Fault, client: ServiceClient) -> None:
    flown_m = 0.0
    while flown_m < fault.after_m:
        await asyncio.sleep(0.2)
        with suppress(CallError):
            flown_m = (await client.call("GET", "/v1/vehicle", VehicleState)).path_m
    for what, more in fault.told:
        autopilot.told(what, **more)


async def _rested(autopilot: StandIn, client: ServiceClient) -> tuple[bool, str]:
    """Whether it comes to rest, and where: on the ground, or in the air where somebody holds it."""
    began, before = time.monotonic(), [0.0, 0.0, 99.0]
    while True:
        told = autopilot.told()
        under_way = told["mode"] in UNDER_WAY
        still = sum(abs(a - b) for a, b in zip(told["position"], before, strict=True)) < 0.3
        if not told["in_air"] and not told["armed"]:
            return True, f"on the ground, {told['mode']}"
        if time.monotonic() > began + (DOWN_WITHIN_S if under_way else RESTS_WITHIN_S):
            return (
                still and not under_way,
                f"{-told['position'][2]:.1f} m high, {told['mode']}, {'still' if still else 'moving'}",
            )
        before = told["position"]
        await asyncio.sleep(1.0)


async def flown(samples: Sequence[str], faults: Sequence[Fault], firmware: str, folder: Path) -> list[Ended]:
    """Each of `samples` with the fault beside it."""
    ended = []
    ports = free_ports(FLIGHT_SERVICES)
    async with Processes(ports, folder / "logs", environment=process_environment()) as group:
        field = Field(folder, firmware, group.addresses)
        for number, (sample, fault) in enumerate(zip(samples, faults, strict=True), 1):
            try:
                one = await field.fly(sample, fault, number)
            except CannotStart as error:
                one = Ended(sample, fault.name, "failed", str(error), 0, 0.0, False, "not begun", False)
            sys.stdout.write(json.dumps(one._asdict(), ensure_ascii=False) + "\n")
            sys.stdout.flush()
            ended.append(one)
    return ended


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--faults", action="store_true")
    reader.add_argument("--count", type=int, default=50)
    reader.add_argument("--first", type=int, default=0, help="the first fault's number")
    reader.add_argument("--firmware", choices=("px4", "ardupilot"), default="px4")
    asked = reader.parse_args()
    samples = sample_library.names()
    faults = [FAULTS[0]] * len(samples)
    if asked.faults:
        samples = [SAMPLE] * asked.count
        faults = [FAULTS[(asked.first + number) % len(FAULTS)] for number in range(asked.count)]
    with tempfile.TemporaryDirectory() as folder:
        ended = asyncio.run(flown(samples, faults, asked.firmware, Path(folder)))
    bad = [one for one in ended if not one.rests or one.outcome == "failed"]
    sys.stdout.write(
        f"{len(ended)} flown, {sum(one.outcome == 'delivered' for one in ended)} delivered, {len(bad)} bad\n"
    )
    raise SystemExit(1 if bad else 0)


if __name__ == "__main__":
    main()

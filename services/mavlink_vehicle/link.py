"""The link to an autopilot: what it says goes into a `Telemetry`, and it is told what to do. By MAVSDK, for PX4 and
ArduCopter.

Errors: CommandRefused where the autopilot says no, LinkLost where it says nothing.
"""

import asyncio
import json
import logging
from collections.abc import Awaitable
from contextlib import suppress
from functools import cache
from typing import Any, Literal, TypeVar

from mavsdk.asyncio import Autopilot as Firmwares
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.exceptions import MavsdkError
from mavsdk.logging import LogLevel, log_subscribe
from mavsdk.plugins.mavlink_direct import MavlinkMessage
from mavsdk.plugins.offboard import PositionNedYaw

from services.mavlink_vehicle.frames import Ned
from services.mavlink_vehicle.listener import Listener
from services.mavlink_vehicle.telemetry import Telemetry

log = logging.getLogger("mavlink_vehicle.link")

Firmware = Literal["px4", "ardupilot", "other"]
FIRMWARES: dict[Any, Firmware] = {Firmwares.PX4: "px4", Firmwares.ARDUPILOT: "ardupilot"}
ANSWERS_WITHIN_S = 8.0
"""Longer than MAVSDK waits for an autopilot's answer."""
T = TypeVar("T")
LOOK_FOR_S = 1.0
LOOK_EVERY_S, HEARTBEATS_WITHIN = 0.1, 30
NO_WORD = frozenset({"TIMEOUT", "NO_SYSTEM", "CONNECTION_ERROR"})
GUIDED = 4
"""ArduCopter's number of the mode that takes set-points."""
SET_MODE, CUSTOM_MODE = 176, 1
WORDS_FOLLOW_S = 0.5
"""An autopilot says why a moment after it has said no."""


class CommandRefused(Exception):
    """The autopilot does not do it; the message says what, and why in its own words."""


class LinkLost(Exception):
    """The autopilot says nothing."""


class Link:
    """`address`: MAVSDK's, such as `udpin://127.0.0.1:14540` or `serial:///dev/ttyACM0:57600`. Call `start`, and
    `close` at the end."""

    def __init__(self, address: str, telemetry: Telemetry) -> None:
        self.address = address
        self.telemetry = telemetry
        self.firmware: Firmware = "other"
        self._system_id = 1
        self._mavsdk: Mavsdk | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._calls: set[asyncio.Future[Any]] = set()
        self._action: ActionAsync | None = None
        self._offboard: OffboardAsync | None = None
        self._direct: MavlinkDirectAsync | None = None

    @property
    def found(self) -> bool:
        """An autopilot was heard at least once."""
        return self._action is not None

    async def start(self) -> None:
        """Listens from now on; an autopilot may come whenever it likes. Raises LinkLost for an address that can't be
        listened at."""
        _log_here()
        # as a ground station: PX4 does not arm without one, and this one is there as long as the mission may fly
        self._mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
        try:
            await self._mavsdk.add_any_connection(self.address)
        except MavsdkError as error:
            self._mavsdk.destroy()
            self._mavsdk = None
            raise LinkLost(f"{self.address} can't be opened: {error}") from None
        self._tasks.append(asyncio.create_task(self._find()))

    async def close(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        if self._calls:  # a thread waits in MAVSDK for each; without MAVSDK it would wait for ever
            await asyncio.wait(self._calls, timeout=ANSWERS_WITHIN_S)
        if self._mavsdk is not None:
            await asyncio.to_thread(self._mavsdk.destroy)
            self._mavsdk = None

    async def arm(self) -> None:
        await self._do("arm", self._plugin.arm())

    async def disarm(self) -> None:
        await self._do("disarm", self._plugin.disarm())

    async def take_off(self, height_m: float) -> None:
        """PX4 rises to the height of its own parameter, ArduCopter to `height_m`."""
        if self.firmware != "px4":
            await self._do("take off", self._plugin.set_takeoff_altitude(height_m))
        await self._do("take off", self._plugin.takeoff())

    async def land(self) -> None:
        await self._do("land", self._plugin.land())

    async def return_to_launch(self) -> None:
        await self._do("return to launch", self._plugin.return_to_launch())

    async def hold(self) -> None:
        """Holds by itself. ArduCopter does so in GUIDED, at its last set-point: its LOITER obeys a stick, which may lie
        at the bottom."""
        if self.firmware != "ardupilot":
            await self._do("hold", self._plugin.hold())

    async def take_set_points(self) -> None:
        """From now on it flies to set-points; PX4 wants to have heard some before. On the ground only ArduCopter takes
        this, whose take-off begins with it."""
        if self.firmware != "ardupilot":
            assert self._offboard is not None, "found"
            await self._do("take set-points", self._offboard.start())
            return
        await self._set_mode(GUIDED)

    async def set_point(self, ned: Ned) -> None:
        """One set-point of position and heading; MAVSDK sends it again at 20 Hz until the next one."""
        if self._offboard is None:
            raise LinkLost(self.silence)
        point = PositionNedYaw(ned.north_m, ned.east_m, ned.down_m, ned.heading_deg)
        with suppress(MavsdkError):  # the next one follows at once, and telemetry says that the link is lost
            await self._called(self._offboard.set_position_ned(point))

    @property
    def _plugin(self) -> ActionAsync:
        if self._action is None:
            raise LinkLost(self.silence)
        return self._action

    @property
    def silence(self) -> str:
        """What is not heard, for people."""
        if not self.found:
            return f"no autopilot was heard at {self.address} yet: start it, or say with --autopilot where it is"
        return f"no word from the autopilot for {self.telemetry.silent_s:.0f} s"

    async def _do(self, what: str, call: Awaitable[object]) -> None:
        """Raises CommandRefused, LinkLost."""
        try:
            await self._called(call)
        except MavsdkError as error:
            result = getattr(getattr(error, "result", None), "name", str(error))
            if result in NO_WORD:
                raise LinkLost(f"the autopilot does not answer: it was to {what} ({result})") from None
            await asyncio.sleep(WORDS_FOLLOW_S)
            words = self.telemetry.last_words
            raise CommandRefused(f"the autopilot refuses to {what}: {result}{words}") from None

    async def _called(self, call: Awaitable[T]) -> T:
        """One call of MAVSDK, which goes on to its end where whoever waits is cancelled."""
        future = asyncio.ensure_future(call)
        self._calls.add(future)
        future.add_done_callback(self._ended)
        return await asyncio.shield(future)

    def _ended(self, call: asyncio.Future[Any]) -> None:
        """What it failed of is told here too: whoever waited may be gone, and asyncio would log it as an error."""
        self._calls.discard(call)
        if not call.cancelled() and (failed := call.exception()) is not None:
            log.debug("a call of MAVSDK ended with: %s", failed)

    async def _set_mode(self, number: int) -> None:
        if self._direct is None:
            raise LinkLost(self.silence)
        fields = {
            "target_system": self._system_id,
            "target_component": 1,
            "command": SET_MODE,
            "param1": CUSTOM_MODE,
            "param2": number,
        }
        message = MavlinkMessage(message_name="COMMAND_LONG", fields_json=json.dumps(fields))
        try:
            answer = json.loads((await self._called(self._direct.send_command(message))).fields_json)
        except MavsdkError as error:
            raise LinkLost(f"the autopilot does not answer: it was to change its mode ({error})") from None
        if answer.get("result") != 0:
            words = self.telemetry.last_words
            raise CommandRefused(f"the autopilot refuses to take set-points: {answer.get('result')}{words}")

    async def _find(self) -> None:
        """Waits for the autopilot, and listens to it."""
        assert self._mavsdk is not None, "started"
        system: System | None = None
        while system is None:
            system = await self._mavsdk.first_autopilot(LOOK_FOR_S)
        self._offboard, self._direct = OffboardAsync(system), MavlinkDirectAsync(system)
        self._system_id = await system.get_system_id()
        self.firmware = await _firmware(system)
        self._action = ActionAsync(system)
        self.telemetry.heard()
        log.warning("an autopilot is heard at %s: %s", self.address, self.firmware)
        said = TelemetryAsync(system)
        listener = Listener(said, self.telemetry)
        self._tasks += [asyncio.create_task(run) for run in listener.streams()]
        self._tasks.append(asyncio.create_task(listener.ask_for_streams(self._called)))


async def _firmware(system: System) -> Firmware:
    """A system counts as found when anything of it is heard; what flies it tells its heartbeat, one a second."""
    for _ in range(HEARTBEATS_WITHIN):
        if (known := FIRMWARES.get(await system.autopilot_type())) is not None:
            return known
        await asyncio.sleep(LOOK_EVERY_S)
    return "other"


@cache
def _log_here() -> None:
    """Once in a process: a second subscription frees the first one under the threads that call it."""
    log_subscribe(_logged)


def _logged(level: LogLevel, message: str, file: str | None, line: int) -> bool:
    """MAVSDK's own lines, as ours; true: it writes none itself."""
    # what matters of them is told by the calls and the telemetry; with nobody there they come twenty a second
    log.log(logging.INFO if level >= LogLevel.WARN else logging.DEBUG, message)
    return True

"""What an autopilot says, stream by stream, into a `Telemetry`: MAVSDK's units and names end here."""

import asyncio
import math
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import suppress
from typing import Any, NamedTuple, cast

from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.exceptions import MavsdkError
from mavsdk.plugins.telemetry import LandedState, StatusTextType

from services.mavlink_vehicle.frames import Ned, enu_of, yaw_of
from services.mavlink_vehicle.telemetry import MODES, Mode, Telemetry

POSE_HZ, STATE_HZ = 20.0, 2.0
SLOW_HZ = 8.0
ASK_AGAIN_S = 5.0


class _Charge(NamedTuple):
    """Of one battery: what is left of it, null where that is not known, and its voltage."""

    remaining: float | None
    voltage_v: float | None


class Listener:
    """Of one autopilot."""

    def __init__(self, said: TelemetryAsync, telemetry: Telemetry) -> None:
        self._said = said
        self.telemetry = telemetry
        self._batteries: dict[int, _Charge] = {}

    async def ask_for_streams(self, call: Callable[[Awaitable[None]], Awaitable[None]]) -> None:
        """ArduPilot sends what it is asked for, and forgets it when it is started again; it does not always say that it
        has heard; and others on the link, such as MAVProxy, ask for slower streams. `call` makes a call of MAVSDK."""
        said = self._said
        asked: list[tuple[Callable[[float], Awaitable[None]], float]] = [
            (said.set_rate_position_velocity_ned, POSE_HZ),
            (said.set_rate_attitude_euler, POSE_HZ),
            (said.set_rate_landed_state, STATE_HZ),
            (said.set_rate_health, STATE_HZ),
            (said.set_rate_battery, STATE_HZ),
            (said.set_rate_home, STATE_HZ),
        ]
        while True:
            telemetry = self.telemetry
            if telemetry.place is None or telemetry.landed is None or telemetry.poses.rate_hz < SLOW_HZ:
                for ask, hz in asked:
                    with suppress(MavsdkError):
                        await call(ask(hz))
            await asyncio.sleep(ASK_AGAIN_S if self.telemetry.place is not None else 1.0)

    def streams(self) -> list[Coroutine[Any, Any, None]]:
        """Each to be run until it is cancelled."""
        said = self._said
        taken: list[tuple[AsyncIterator[Any], Callable[[Any], None]]] = [
            (said.subscribe_attitude_euler(), self._turned),
            (said.subscribe_position_velocity_ned(), self._moved),
            (said.subscribe_flight_mode(), self._changed_mode),
            (said.subscribe_armed(), self._armed),
            (said.subscribe_landed_state(), self._landed),
            (said.subscribe_health(), self._fared),
            (said.subscribe_battery(), self._drained),
            (said.subscribe_home(), self._homed),
            (said.subscribe_status_text(), self._spoke),
        ]
        return [_follow(stream, take) for stream, take in taken]

    def _turned(self, angle: Any) -> None:
        self.telemetry.heard()
        self.telemetry.yaw = yaw_of(angle.yaw_deg)

    def _moved(self, told: Any) -> None:
        self.telemetry.heard()
        at, v = told.position, told.velocity
        place = enu_of(Ned(at.north_m, at.east_m, at.down_m, 0.0))
        if all(map(math.isfinite, place)):
            self.telemetry.moved(place, math.hypot(v.north_m_s, v.east_m_s, v.down_m_s))

    def _changed_mode(self, told: Any) -> None:
        self.telemetry.heard()
        self.telemetry.mode_told_s = self.telemetry.clock()
        self.telemetry.mode = _mode(told)

    def _armed(self, told: bool) -> None:
        self.telemetry.heard()
        self.telemetry.armed = bool(told)

    def _landed(self, told: Any) -> None:
        self.telemetry.heard()
        if told != LandedState.UNKNOWN:
            self.telemetry.landed = told == LandedState.ON_GROUND

    def _fared(self, told: Any) -> None:
        self.telemetry.heard()
        needed = {
            "a calibrated gyroscope": told.is_gyrometer_calibration_ok,
            "a calibrated accelerometer": told.is_accelerometer_calibration_ok,
            "a calibrated magnetometer": told.is_magnetometer_calibration_ok,
            "a position": told.is_local_position_ok,
            "a home position": told.is_home_position_ok,
        }
        self.telemetry.missing = tuple(name for name, there in needed.items() if not there)
        self.telemetry.armable = bool(told.is_armable)

    def _drained(self, told: Any) -> None:
        self.telemetry.heard()
        left, volts = told.remaining_percent, told.voltage_v
        remaining = left / 100.0 if math.isfinite(left) and 0.0 <= left <= 100.0 else None
        self._batteries[told.id] = _Charge(remaining, volts if math.isfinite(volts) and 0.0 < volts < 1000.0 else None)
        # the one that is empty first; those that tell nothing of themselves count where no other does
        first = min(self._batteries.values(), key=lambda charge: 2.0 if charge.remaining is None else charge.remaining)
        self.telemetry.remaining, self.telemetry.voltage_v = first

    def _homed(self, told: Any) -> None:
        place = enu_of(Ned(told.local_north_m, told.local_east_m, told.local_down_m, 0.0))
        if all(map(math.isfinite, place)):
            self.telemetry.home = place

    def _spoke(self, told: Any) -> None:
        self.telemetry.heard()
        if told.type >= StatusTextType.WARNING:
            self.telemetry.warned(told.text)


async def _follow(stream: AsyncIterator[Any], take: Callable[[Any], None]) -> None:
    async for told in stream:
        take(told)


def _mode(told: Any) -> Mode:
    name = str(getattr(told, "name", "unknown")).lower()
    return cast(Mode, name) if name in MODES else "unknown"

"""The stand-in's MAVLink: what MAVSDK needs to hear, and what it sends, over UDP."""

import math
import socket
import time
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.autopilot.modes import asked_mode, custom_mode
from tests.autopilot.pilot import Autopilot

LATITUDE_DEG, LONGITUDE_DEG, ALTITUDE_M = 47.397742, 8.545594, 488.0
METRES_A_DEGREE = 111_320.0
Message = mavlink.MAVLink_message
FIRMWARES = {"px4": mavlink.MAV_AUTOPILOT_PX4, "ardupilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA}
ALWAYS_HZ = {
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 2.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 30.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 10.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 30.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 2.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 2.0,
}
"""PX4 sends these unasked; ArduPilot sends what it was asked for."""
COMPANY = (
    (0, mavlink.MAV_COMP_ID_GIMBAL, mavlink.MAV_TYPE_GIMBAL, 0),
    (0, mavlink.MAV_COMP_ID_CAMERA, mavlink.MAV_TYPE_CAMERA, 0),
    (0, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER, mavlink.MAV_TYPE_ONBOARD_CONTROLLER, 0),
    (255, mavlink.MAV_COMP_ID_MISSIONPLANNER, mavlink.MAV_TYPE_GCS, 192),
)
"""Whose heartbeats come beside the autopilot's: system (0: the drone's own), component, type, base mode."""
HEALTHY = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
)


def _company(system: int) -> list[tuple[int, int]]:
    return [(number or system, component) for number, component, _, _ in COMPANY]


class Link:
    """Speaks to whoever listens at `port` of the loopback. `set_points` are the times at which set-points came."""

    def __init__(self, autopilot: Autopilot, port: int, system: int = 1, *, company: bool = False) -> None:
        """`system`: its number. `company`: a gimbal, a camera and a computer of the same drone, and a ground station,
        are heard at the same port."""
        self._autopilot = autopilot
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self._to = ("127.0.0.1", port)
        self._mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self._system = system
        self._company = [mavlink.MAVLink(None, *who) for who in _company(system)] if company else []
        self._mav.robust_parsing = True
        self._every_s: dict[int, float] = {}
        if autopilot.firmware == "px4":
            self._every_s = {number: 1.0 / hz for number, hz in ALWAYS_HZ.items()}
        self._due: dict[int, float] = {}
        self._company_s = 0.0
        # its own come half a second later: who listens hears the others, and its streams, before it
        self._heartbeat_s = time.monotonic() - 0.5
        self._began = time.monotonic()
        self.set_points: list[float] = []
        self.commands: list[int] = []

    @property
    def _silent(self) -> bool:
        return self._autopilot.time_s < self._autopilot.faults.silent_until_s

    def receive(self) -> None:
        """Handles all that has come."""
        while True:
            try:
                data = self._socket.recv(4096)
            except (BlockingIOError, ConnectionRefusedError):
                return
            for message in (self._mav.parse_buffer(data) or ()) if not self._silent else ():
                self._handle(message)

    def send_due(self) -> None:
        """Whatever is due by now."""
        if self._silent:
            return
        now = time.monotonic()
        if now - self._company_s >= 1.0:
            self._company_s = now
            self._others_heartbeats()
        if now - self._heartbeat_s >= 1.0:
            self._heartbeat_s = now
            self._heartbeat()
        for number, every_s in self._every_s.items():
            if now >= self._due.get(number, 0.0):
                self._due[number] = max(now, self._due.get(number, now) + every_s)
                self._told(number)
        while self._autopilot.said:
            severity, text = self._autopilot.said.pop(0)
            self._send(mavlink.MAVLink_statustext_message(severity, text.encode()[:50]))

    def _send(self, message: Message) -> None:
        try:
            self._socket.sendto(message.pack(self._mav), self._to)
        except ConnectionRefusedError:
            return  # nobody listens yet, or any more

    def stream_at(self, hz: float) -> None:
        """Somebody else on the link asks for all streams at that rate, as MAVProxy does every 15 s."""
        self._every_s = dict.fromkeys(ALWAYS_HZ, 1.0 / hz)

    def _others_heartbeats(self) -> None:
        for number, mav in enumerate(self._company):
            kind, base = COMPANY[number][2:]
            beat = mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_INVALID, base, 0, 4, 3)
            self._socket.sendto(beat.pack(mav), self._to)

    def _heartbeat(self) -> None:
        autopilot = self._autopilot
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if autopilot.armed else 0
        state = mavlink.MAV_STATE_ACTIVE if autopilot.armed else mavlink.MAV_STATE_STANDBY
        number = custom_mode(autopilot.firmware, autopilot.mode)
        firmware = FIRMWARES[autopilot.firmware]
        self._send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_QUADROTOR, firmware, base, number, state, 3))

    def _handle(self, message: Message) -> None:
        kind = message.get_type()
        if kind == "COMMAND_LONG":
            self._command(message)
        elif kind == "SET_POSITION_TARGET_LOCAL_NED" and message.target_system in (0, self._system):
            self.set_points.append(time.monotonic())
            yaw = None if message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE else message.yaw
            self._autopilot.set_point([message.x, message.y, message.z], yaw)

    def _command(self, message: Message) -> None:
        """Carries it out, and acknowledges it."""
        number = message.command
        self.commands.append(number)
        before = (self._autopilot.mode, self._autopilot.armed)
        answers: dict[int, Callable[[Message], bool | None]] = {
            mavlink.MAV_CMD_REQUEST_MESSAGE: lambda m: self._told(int(m.param1)),
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            mavlink.MAV_CMD_NAV_TAKEOFF: lambda m: self._autopilot.take_off(m.param7 if m.param7 else None),
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_NAV_LAND: lambda _: self._autopilot.set_mode("land"),
        }
        answer = answers.get(number)
        done = None if answer is None else answer(message)
        result = mavlink.MAV_RESULT_UNSUPPORTED if done is None else mavlink.MAV_RESULT_ACCEPTED
        if done is False:
            result = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        self._send(
            mavlink.MAVLink_command_ack_message(
                number, result, target_system=message.get_srcSystem(), target_component=message.get_srcComponent()
            )
        )
        if (self._autopilot.mode, self._autopilot.armed) != before:
            self._heartbeat_s = 0.0

    def _arm(self, message: Message) -> bool:
        return self._autopilot.arm() if message.param1 == 1.0 else self._autopilot.disarm()

    def _set_mode(self, message: Message) -> bool:
        mode = asked_mode(self._autopilot.firmware, int(message.param2), int(message.param3))
        return mode is not None and self._autopilot.set_mode(mode)

    def _set_interval(self, message: Message) -> bool:
        every_us = message.param2
        if every_us < 0:
            self._every_s.pop(int(message.param1), None)
        else:
            self._every_s[int(message.param1)] = max(0.01, every_us / 1e6 or 1.0)
        return True

    def _told(self, number: int) -> bool | None:
        """Sends that message; null where it is none of ours."""
        build = {
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._version,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._home_position,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._quaternion,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_state,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery_status,
        }.get(number)
        if build is None:
            return None
        message = build()
        if message is not None:
            self._send(message)
        return True

    @property
    def _left(self) -> int:
        return -1 if self._autopilot.faults.no_charge else round(100 * self._autopilot.battery)

    @property
    def _ms(self) -> int:
        return int(1000 * (time.monotonic() - self._began))

    def _version(self) -> Message:
        version = (
            mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        )
        return mavlink.MAVLink_autopilot_version_message(
            version, 0x010F0400, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 1
        )

    def _home_position(self) -> Message | None:
        if not self._autopilot.healthy:
            return None
        return mavlink.MAVLink_home_position_message(
            int(LATITUDE_DEG * 1e7),
            int(LONGITUDE_DEG * 1e7),
            int(ALTITUDE_M * 1e3),
            0.0,
            0.0,
            0.0,
            [1.0, 0.0, 0.0, 0.0],
            0.0,
            0.0,
            0.0,
        )

    def _sys_status(self) -> Message:
        autopilot = self._autopilot
        there = HEALTHY | mavlink.MAV_SYS_STATUS_SENSOR_GPS | mavlink.MAV_SYS_STATUS_PREARM_CHECK
        well = HEALTHY
        if autopilot.healthy:
            well |= mavlink.MAV_SYS_STATUS_SENSOR_GPS
            well |= mavlink.MAV_SYS_STATUS_PREARM_CHECK if autopilot.armable else 0
        left = self._left
        return mavlink.MAVLink_sys_status_message(there, there, well, 200, 15_800, 1200, left, 0, 0, 0, 0, 0, 0)

    def _gps(self) -> Message:
        fix = 3 if self._autopilot.healthy else 0
        latitude, longitude = self._place()
        return mavlink.MAVLink_gps_raw_int_message(
            self._ms * 1000, fix, latitude, longitude, int(ALTITUDE_M * 1e3), 80, 80, 0, 0, 12 if fix else 0
        )

    def _attitude(self) -> Message:
        return mavlink.MAVLink_attitude_message(self._ms, 0.0, 0.0, self._autopilot.body.yaw, 0.0, 0.0, 0.0)

    def _quaternion(self) -> Message:
        half = self._autopilot.body.yaw / 2.0
        return mavlink.MAVLink_attitude_quaternion_message(
            self._ms, math.cos(half), 0.0, 0.0, math.sin(half), 0.0, 0.0, 0.0
        )

    def _local_position(self) -> Message | None:
        if self._autopilot.time_s < self._autopilot.ekf_s:
            return None
        body = self._autopilot.body
        return mavlink.MAVLink_local_position_ned_message(self._ms, *body.measured, *body.velocity)

    def _place(self) -> tuple[int, int]:
        north, east, _ = self._autopilot.body.position
        shrink = math.cos(math.radians(LATITUDE_DEG))
        return (
            int((LATITUDE_DEG + north / METRES_A_DEGREE) * 1e7),
            int((LONGITUDE_DEG + east / METRES_A_DEGREE / shrink) * 1e7),
        )

    def _global_position(self) -> Message | None:
        if not self._autopilot.healthy:
            return None
        body = self._autopilot.body
        height_mm = int(1000 * body.height_m)
        heading = int(math.degrees(body.yaw) % 360.0 * 100) % 36_000
        return mavlink.MAVLink_global_position_int_message(
            self._ms, *self._place(), int(ALTITUDE_M * 1e3) + height_mm, height_mm, 0, 0, 0, heading
        )

    def _extended_state(self) -> Message:
        autopilot = self._autopilot
        landed = mavlink.MAV_LANDED_STATE_IN_AIR if autopilot.in_air else mavlink.MAV_LANDED_STATE_ON_GROUND
        return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed)

    def _battery_status(self) -> Message:
        left = self._left
        cells = [3950] * 4 + [65_535] * 6
        return mavlink.MAVLink_battery_status_message(0, 1, 1, 32_767, cells, 1200, -1, -1, left)

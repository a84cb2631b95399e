"""What the stand-in's autopilot does: arming, modes, failsafes. Time goes on by `step`; nothing here knows MAVLink."""

import math
from dataclasses import dataclass, field

from tests.autopilot.flight import DT_S, Body, Vector
from tests.autopilot.modes import Firmware, Mode

TAKE_OFF_M = 2.5
"""PX4's MIS_TAKEOFF_ALT."""
RTL_M = 12.0
LAND_M_S = 1.2
OFFBOARD_LOST_S = 0.5
OFFBOARD_NEEDS_S = 0.15
"""So long a stream of set-points must have come before PX4 takes the mode."""
DISARM_S = 0.5
BLIND_S = 1.0


@dataclass
class Faults:
    """What is asked for. `no_gps`: the estimate is not good enough to fly by. `refuse`: modes that are refused.
    `off_m`: so far beside a set-point it comes to rest, NED. `refuse_arming_until_s`: a self-test that takes its time.
    `no_charge`: it does not know how full its battery is."""

    no_gps: bool = False
    refuse_arming: bool = False
    refuse: tuple[str, ...] = ()
    refuse_arming_until_s: float = 0.0
    silent_until_s: float = 0.0
    off_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    no_charge: bool = False
    creep_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass
class Autopilot:
    """`ekf_s`: seconds until the estimate is good. `battery_s`: of hovering on a full battery."""

    firmware: Firmware = "px4"
    ekf_s: float = 0.5
    battery_s: float = 1200.0
    body: Body = field(default_factory=Body)
    faults: Faults = field(default_factory=Faults)
    time_s: float = 0.0
    mode: Mode = "hold"
    armed: bool = False
    battery: float = 1.0
    said: list[tuple[int, str]] = field(default_factory=list)
    offboard_lost: int = 0
    _target: Vector | None = None
    _yaw: float | None = None
    _wanted: tuple[Vector, float | None] | None = None
    _streaming_since_s: float = -1.0
    _heard_s: float = -10.0
    _home: Vector = field(default_factory=lambda: [0.0, 0.0, 0.0])
    _landed_s: float = 0.0
    _blind_s: float = 0.0

    @property
    def healthy(self) -> bool:
        return self.time_s >= self.ekf_s and not self.faults.no_gps

    @property
    def armable(self) -> bool:
        asks = self.faults.refuse_arming or self.time_s < self.faults.refuse_arming_until_s
        return self.healthy and not asks

    @property
    def in_air(self) -> bool:
        return self.body.height_m > 0.05

    def say(self, severity: int, text: str) -> None:
        """A STATUSTEXT; severity as MAVLink has it: 3 is an error, 6 information."""
        self.said.append((severity, text))

    def arm(self) -> bool:
        if not self.armable:
            self.say(3, "Arming denied: resolve health failures first")
            return False
        if not self.armed:
            self.armed, self._home, self._landed_s = True, list(self.body.position), self.time_s
            self._stay()
        return True

    def disarm(self) -> bool:
        if self.in_air:
            return False
        self.armed = False
        return True

    def take_off(self, height_m: float | None) -> bool:
        """`height_m`: ArduCopter's; PX4 has a parameter."""
        ready = self.armed and self.healthy
        if self.firmware == "ardupilot":
            if not ready or self.mode != "offboard" or height_m is None or self.in_air:
                return False
            self._climb_to(height_m)
            return True
        if not ready:
            return False
        self.mode = "takeoff"
        self._climb_to(TAKE_OFF_M)
        return True

    def set_mode(self, mode: Mode) -> bool:
        """Asked for by whoever speaks MAVLink, or by the pilot's hand."""
        if mode in self.faults.refuse or (mode not in ("stabilized", "land") and not self.healthy):
            return False
        if mode == "offboard" and self.firmware == "px4":
            streamed_s = self._heard_s - self._streaming_since_s
            if self.time_s - self._heard_s > OFFBOARD_LOST_S or streamed_s < OFFBOARD_NEEDS_S:
                self.say(3, "Switching to Offboard is currently not available")
                return False
        self.mode = mode
        self._stay()
        if mode == "rtl":
            self._target[2] = min(self.body.position[2], self._home[2] - RTL_M)  # type: ignore[index]
        if mode == "offboard" and self.firmware == "px4" and self._wanted is not None:
            self._target, self._yaw = list(self._wanted[0]), self._wanted[1]
        return True

    def set_point(self, place: Vector, yaw: float | None) -> None:
        """SET_POSITION_TARGET_LOCAL_NED."""
        if self.time_s - self._heard_s > OFFBOARD_LOST_S:
            self._streaming_since_s = self.time_s
        self._heard_s = self.time_s
        self._wanted = (place, yaw)
        if self.mode != "offboard":
            return
        if self.firmware == "ardupilot" and not self.in_air:
            self.say(6, "Guided: set-point on the ground ends the take-off")
            self._stay()
            return
        self._target, self._yaw = [p + o for p, o in zip(place, self.faults.off_m, strict=True)], yaw

    def set_anew(self, shift_m: Vector) -> None:
        """The estimate's origin is set anew, as filters do once they hear of satellites; nothing moves."""
        body = self.body
        body.position = [p + s for p, s in zip(body.position, shift_m, strict=True)]
        body.ground_m += shift_m[2]
        self._home = [h + s for h, s in zip(self._home, shift_m, strict=True)]

    def step(self) -> None:
        """DT_S of flight."""
        self.time_s += DT_S
        self.body.position = [p + c * DT_S for p, c in zip(self.body.position, self.faults.creep_m_s, strict=True)]
        if self.armed and self.in_air:
            self.battery = max(0.0, self.battery - DT_S / self.battery_s)
        if self.mode == "offboard" and self.firmware == "px4" and self.time_s - self._heard_s > OFFBOARD_LOST_S:
            self.offboard_lost += 1
            self.say(4, "Offboard control lost")
            self.mode = "hold"
            self._stay()
        if not self.armed:
            self.body.step(None, None)
            return
        self._blind_s = self._blind_s + DT_S if self.faults.no_gps and self.in_air else 0.0
        if self._blind_s > BLIND_S and self.mode not in ("land", "stabilized"):
            self.say(2, "Failsafe activated: no position, descending")
            self.mode = "land"
            self._stay()
        self._fly()

    def _fly(self) -> None:
        body = self.body
        if self.mode == "takeoff" and self._target is not None and abs(body.position[2] - self._target[2]) < 0.2:
            self.mode = "hold"
        if self.mode == "rtl" and self._target is not None:
            self._return()
        descends = LAND_M_S if self.mode == "land" else None
        body.step(self._target, self._yaw, descends)
        waits = self.mode == "takeoff" or (self.firmware == "ardupilot" and self.mode == "offboard")
        if self.in_air or waits:
            self._landed_s = self.time_s
        if self.time_s - self._landed_s > DISARM_S and self.mode in ("land", "rtl"):
            self.armed = False
            self.mode = "land" if self.firmware == "ardupilot" else "hold"

    def _return(self) -> None:
        body, target = self.body, self._target
        assert target is not None
        high = abs(body.position[2] - target[2]) < 0.5
        home_m = math.dist(body.position[:2], self._home[:2])
        if high:
            target[:2] = self._home[:2]
        if high and home_m < 0.4:
            self.mode = "land"

    def _climb_to(self, height_m: float) -> None:
        self._stay()
        assert self._target is not None
        self._target[2] = self._home[2] - height_m

    def _stay(self) -> None:
        self._target, self._yaw = list(self.body.position), self.body.yaw

"""The flight modes of the stand-in, and the numbers by which PX4 and ArduCopter name theirs in a heartbeat."""

from typing import Literal

Mode = Literal["hold", "takeoff", "offboard", "rtl", "land", "position", "stabilized", "mission"]
Firmware = Literal["px4", "ardupilot"]

_PX4: dict[Mode, tuple[int, int]] = {
    "takeoff": (4, 2),
    "hold": (4, 3),
    "mission": (4, 4),
    "rtl": (4, 5),
    "land": (4, 6),
    "offboard": (6, 0),
    "position": (3, 0),
    "stabilized": (7, 0),
}
_ARDUCOPTER: dict[Mode, int] = {
    "stabilized": 0,
    "mission": 3,
    "offboard": 4,
    "hold": 5,
    "rtl": 6,
    "land": 9,
    "position": 16,
}


def custom_mode(firmware: Firmware, mode: Mode) -> int:
    """The heartbeat's number."""
    if firmware == "ardupilot":
        return _ARDUCOPTER[mode]
    main, sub = _PX4[mode]
    return main << 16 | sub << 24


def asked_mode(firmware: Firmware, main: int, sub: int) -> Mode | None:
    """The mode that MAV_CMD_DO_SET_MODE asks for; None for one that there is not."""
    if firmware == "ardupilot":
        return next((mode for mode, number in _ARDUCOPTER.items() if number == main), None)
    return next((mode for mode, numbers in _PX4.items() if numbers == (main, sub if main == 4 else 0)), None)

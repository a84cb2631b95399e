"""Who flies the vehicle: nobody asked yet, this service, or somebody else.

This service knows which flight modes its own commands lead to. Any other is somebody else's: a pilot's hand, or a
failsafe of the autopilot. From then on nothing is commanded any more until the mission is over, or the vehicle stands
on the ground.
"""

from typing import Literal

from services.mavlink_vehicle.telemetry import Mode, Telemetry

CHANGES_WITHIN_S = 3.0
"""So long an autopilot may go on telling the mode it had before a command."""
BY_ITSELF: frozenset[Mode] = frozenset({"takeoff", "hold", "return_to_launch", "land", "ready"})
"""An autopilot's failsafes lead to these as well as a pilot."""


class Control:
    """`taken` says who flies it in our place, for people; null where nobody does."""

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._expected: frozenset[Mode] = frozenset()
        self._before: Mode = "unknown"
        self._asked_s = 0.0
        self._confirmed = False
        self.taken: str | None = None

    @property
    def ours(self) -> bool:
        return bool(self._expected) and self.taken is None

    def expect(self, *modes: Mode) -> None:
        """A command was given, or is about to be, that leads to these modes."""
        self._before = self._telemetry.mode
        self._expected = frozenset(modes)
        self._asked_s = self._telemetry.clock()
        self._confirmed = False

    def leave(self) -> None:
        """The mission needs the vehicle no more: whoever wants it may have it."""
        self._expected, self.taken = frozenset(), None

    def check(self) -> None:
        """Compares the mode told last with those that our commands lead to."""
        telemetry = self._telemetry
        if not self.ours or telemetry.mode_told_s < self._asked_s:
            return
        mode = telemetry.mode
        if mode in self._expected:
            self._confirmed = True
            return
        # an autopilot may pass through modes of its own on the way; a stick moved is somebody's at once
        on_the_way = mode == self._before or mode in BY_ITSELF
        if on_the_way and not self._confirmed and telemetry.clock() - self._asked_s < CHANGES_WITHIN_S:
            return
        who = "the pilot or the autopilot itself" if mode in BY_ITSELF else "the pilot"
        self.taken = f"{who} has taken over: its mode is {mode.upper()}{telemetry.last_words}"

    def in_hand(self) -> Literal["ours", "free", "taken"]:
        """`free`: it flies, nobody of ours has commanded it, and it holds."""
        if self.taken is not None:
            return "taken"
        if self._expected:
            return "ours"
        return "free" if self._telemetry.mode in ("hold", "offboard") else "taken"

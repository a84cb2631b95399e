"""How long a battery lasts, by how fast it has emptied on this mission."""

USUAL_S = 900.0
"""Of a full battery, where nothing was measured."""
TRIED_S = 120.0
"""A first drop, by rounding or by a take-off's load, tells little: the usual counts as much as a flight so long."""


def left_s(remaining: float | None, at_start: float | None, flight_s: float, reserve: float) -> float:
    """Seconds of flight until the reserve is touched. `remaining` now and `at_start` of the mission, shares of a full
    battery; null: not known."""
    now = 1.0 if remaining is None else remaining
    used = max(0.0, (1.0 if at_start is None else at_start) - now)
    endurance_s = (flight_s + TRIED_S) / (used + TRIED_S / USUAL_S)
    return max(0.0, now - reserve) * endurance_s

"""The planner's clearances, no smaller than the drone is and than the operator wants them: the guard would refuse what
was planned with less."""

from pydantic import JsonValue

from contracts.flight_limits import FlightLimits
from contracts.orchestrator import MissionSettings, SearchSettings

ROOM_M = 0.05
"""More than the guard asks for: measured places are not exact."""


def within_limits(settings: MissionSettings, limits: FlightLimits) -> MissionSettings:
    """The same settings, with every radius at least the drone's, every clearance at least the operator's, and no more
    speed than allowed. A search policy's constants are told by their names."""
    least = {
        "drone_radius_m": settings.flight.radius_m,
        "clearance_m": limits.min_clearance_m + ROOM_M,
        "tight_clearance_m": limits.min_clearance_m + ROOM_M,
    }
    approach = settings.approach
    raised = {name: max(getattr(approach, name), least[name]) for name in ("drone_radius_m", "clearance_m")}
    search = settings.viewpoint
    speed = min(settings.flight.max_speed_m_s, limits.max_speed_m_s)
    return settings.model_copy(
        update={
            "approach": approach.model_copy(update=raised),
            "viewpoint": SearchSettings(policy=search.policy, **_raised(search.constants, least)),
            "flight": settings.flight.model_copy(update={"max_speed_m_s": speed}),
        }
    )


def _raised(constants: dict[str, JsonValue], least: dict[str, float]) -> dict[str, JsonValue]:
    """Also within the settings that a policy nests in its own."""
    raised: dict[str, JsonValue] = {}
    for name, value in constants.items():
        if isinstance(value, dict):
            raised[name] = _raised(value, least)
        elif name in least and isinstance(value, int | float):
            raised[name] = max(float(value), least[name])
        else:
            raised[name] = value
    return raised

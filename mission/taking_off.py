"""The way up from the ground, before the cameras have shown anything: what is known beforehand forbids it or not."""

from mission.frames import FlightRefused
from mission.vehicle import Vehicle
from navigation.airspace import Space, outside
from navigation.camera import Place


async def check_take_off(vehicle: Vehicle, height_m: float, space: Space) -> None:
    """May a vehicle that has landed rise so far straight up from where it stands, within `space`? One that flies stays
    where it is. Raises FlightRefused where it may not, PortError."""
    state = await vehicle.state()
    if state.mode != "landed":
        return
    stands = Place(state.pose.x, state.pose.y, state.pose.z)
    refusal = outside(stands, stands._replace(z=stands.z + height_m), space)
    if refusal is not None:
        raise FlightRefused.by(refusal)

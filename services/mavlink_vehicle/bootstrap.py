"""Settings in, the app out: the one place where the parts of mavlink_vehicle are chosen."""

import math

from fastapi import FastAPI

from service_kit.client import ServiceClient
from service_kit.settings import BadSetting, revealed
from services.mavlink_vehicle.app import build_app
from services.mavlink_vehicle.cameras.filmed import BadCameras, FilmedCameras
from services.mavlink_vehicle.cameras.simulated import NoCameras
from services.mavlink_vehicle.course import FlightLimits
from services.mavlink_vehicle.drone import Drone
from services.mavlink_vehicle.flight_ends import Tolerance
from services.mavlink_vehicle.link import Link
from services.mavlink_vehicle.settings import MavlinkVehicleSettings
from services.mavlink_vehicle.simulator import Simulator
from services.mavlink_vehicle.task import Body, Task
from services.mavlink_vehicle.telemetry import Telemetry
from services.mavlink_vehicle.trial import Terms, Trials
from services.mavlink_vehicle.vehicle import Vehicle


def bootstrap(settings: MavlinkVehicleSettings) -> FastAPI:
    """The app as the settings want it. Raises BadSetting."""
    limits = FlightLimits(
        settings.vehicle_max_speed_m_s,
        settings.vehicle_max_acceleration_m_s2,
        math.radians(settings.vehicle_max_yaw_rate_deg_s),
        settings.vehicle_max_climb_m_s,
        settings.vehicle_max_sink_m_s,
    )
    radius_m = settings.vehicle_radius_m
    body = Body(radius_m, radius_m, settings.vehicle_battery_reserve)
    within_m = settings.vehicle_arrives_within_m
    tolerance = Tolerance(corner_m=within_m + 0.2, end_m=within_m, lost_m=within_m + 1.2)
    drone = Drone(Link(settings.autopilot, Telemetry()), tolerance, settings.vehicle_arms_within_s)
    token = revealed(settings.mavlink_vehicle_token)
    if settings.cameras is not None:
        try:
            filmed = FilmedCameras.load(settings.cameras)
        except BadCameras as error:
            raise BadSetting(f"CAMERAS={error}") from None
        vehicle = Vehicle(drone, Task(settings.vehicle_name, filmed, limits, body))
        return build_app(vehicle, filmed=filmed, after_mission=settings.vehicle_after_mission, token=token)
    vehicle = Vehicle(drone, Task(settings.vehicle_name, NoCameras(), limits, body))
    simulator = Simulator(ServiceClient("sim", settings.sim_url, timeout_s=5.0, token=revealed(settings.sim_token)))
    trials = Trials(vehicle, simulator, Terms(limits, settings.vehicle_battery_reserve, settings.vehicle_lease_s))
    return build_app(vehicle, trials=trials, after_mission=settings.vehicle_after_mission, token=token)

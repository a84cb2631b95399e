"""`python -m services.mavlink_vehicle`: the service as a process."""

from service_kit.run import main
from services.mavlink_vehicle.bootstrap import bootstrap
from services.mavlink_vehicle.settings import MavlinkVehicleSettings

if __name__ == "__main__":
    main("mavlink_vehicle", MavlinkVehicleSettings, bootstrap)

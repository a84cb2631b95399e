"""`python -m services.carla_world`: the service as a process."""

from service_kit.run import main
from services.carla_world.bootstrap import bootstrap
from services.carla_world.settings import CarlaWorldSettings

if __name__ == "__main__":
    main("carla_world", CarlaWorldSettings, bootstrap)

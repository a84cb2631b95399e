"""`python -m services.sim`: the service as a process."""

from service_kit.run import main
from services.sim.bootstrap import bootstrap
from services.sim.settings import SimSettings

if __name__ == "__main__":
    main("sim", SimSettings, bootstrap)

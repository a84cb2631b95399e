"""`python -m services.vlm_gateway`: the service as a process, or as several."""

from functools import partial

from service_kit.run import main_in_workers
from service_kit.settings import process_environment
from services.vlm_gateway.bootstrap import build
from services.vlm_gateway.settings import GatewaySettings

if __name__ == "__main__":
    build_here = partial(build, environment=process_environment())
    main_in_workers("vlm_gateway", GatewaySettings, lambda settings: settings.workers, build_here)

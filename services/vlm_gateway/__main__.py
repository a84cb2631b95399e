"""`python -m services.vlm_gateway`: the service as a process."""

from functools import partial

from service_kit.run import main
from service_kit.settings import process_environment
from services.vlm_gateway.bootstrap import build
from services.vlm_gateway.settings import GatewaySettings

if __name__ == "__main__":
    main("vlm_gateway", GatewaySettings, partial(build, environment=process_environment()))

"""What is asked before the first flight: do the services accept our tokens, and is there such a model?"""

import asyncio
import contextlib
import tempfile
from collections.abc import Mapping
from pathlib import Path

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, interruptible, stop
from contracts.vlm_gateway import PreflightQuestion
from launcher.processes import HOST, CannotStart, Processes, free_ports
from mission.clients import Services
from mission.ports import PortError, ServiceRefused, UnknownModel
from service_kit.addresses import PORTS
from service_kit.connections import Connections
from service_kit.settings import BadSetting, process_environment


class CannotFly(Exception):
    """No flight can succeed with these settings; the message says what would be right."""


async def check_flight(services: Services, model: str) -> None:
    """Raises CannotFly where a service refuses our token, there is no such model, or it takes no pictures. Who can't be
    reached is none of this: a mission finds that itself and says so in its result."""
    problems = await asyncio.gather(*(client.token_problem() for client in services.all))
    named = [f"{client.service} {problem}" for client, problem in zip(services.all, problems, strict=True) if problem]
    if named:
        raise CannotFly("; ".join(named))
    with contextlib.suppress(PortError):
        await _find(services, model)


async def _find(services: Services, model: str) -> None:
    """Raises CannotFly where there is no such model or it takes no pictures, PortError."""
    try:
        await services.ports().vision.preflight(PreflightQuestion(model=model))
    except UnknownModel as error:
        raise CannotFly(str(error)) from None
    except ServiceRefused as error:
        if error.status == 422:
            raise CannotFly(str(error)) from None
        raise


def stop_without_model(model: str, gateway: Mapping[str, str]) -> None:
    """Ends the command with one line where a gateway with these settings has no such model, can't load it, or can't be
    started; for commands that ask for hours. The gateway is started for the question alone."""
    try:
        with tempfile.TemporaryDirectory(prefix="logisticsvln-") as logs:
            asyncio.run(interruptible(_check_model(model, gateway, Path(logs))))
    except (CannotFly, BadSetting) as error:
        stop(str(error), WRONG_INPUT)
    except (CannotStart, PortError) as error:
        stop(str(error), FAILED)
    except asyncio.CancelledError:
        stop("interrupted before the first question", INTERRUPTED)


async def _check_model(model: str, gateway: Mapping[str, str], logs: Path) -> None:
    """Raises CannotFly, CannotStart, BadSetting, PortError."""
    environment = process_environment()
    tokens = Connections.read(environment).tokens
    # the oracle asks the simulator when it answers, not before
    oracle = {"ORACLE_SIM_URL": f"http://{HOST}:{PORTS['sim']}"} if model == "oracle" else {}
    extra = {"vlm_gateway": oracle | dict(gateway)}
    async with (
        Processes(free_ports(("vlm_gateway",)), logs, environment=environment, extra=extra) as group,
        Services(group.addresses, tokens) as services,
    ):
        if problem := await services.vlm_gateway.token_problem():
            raise CannotFly(f"vlm_gateway {problem}")
        await _find(services, model)

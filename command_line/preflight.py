"""What is asked before the first flight: do the services accept our tokens, and is there such a model?"""

import asyncio
import contextlib
import tempfile
from collections.abc import Mapping
from pathlib import Path

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, interruptible, stop
from launcher.processes import HOST, CannotStart, Processes, free_ports
from mission.clients import Services
from mission.model_check import WrongModel, check_models
from mission.ports import PortError
from service_kit.addresses import PORTS
from service_kit.connections import Connections
from service_kit.settings import BadSetting, process_environment


class CannotFly(Exception):
    """No flight can succeed with these settings; the message says what would be right."""


async def check_flight(services: Services, model: str | None, parser: str | None) -> None:
    """Without a `model` those of the gateway's roles see. Raises CannotFly where a service refuses our token, or there
    are no such models for their parts. Who can't be reached is none of this: a mission finds that itself and says so
    in its result."""
    problems = await asyncio.gather(*(client.token_problem() for client in services.all))
    named = [f"{client.service} {problem}" for client, problem in zip(services.all, problems, strict=True) if problem]
    if named:
        raise CannotFly("; ".join(named))
    with contextlib.suppress(PortError):
        await _find(services, model, parser, roles=True)


async def _find(services: Services, model: str | None, parser: str | None, *, roles: bool = False) -> None:
    """Raises CannotFly where there are no such models, PortError."""
    try:
        await check_models(services.ports().vision, model, parser, roles=roles)
    except WrongModel as error:
        raise CannotFly(str(error)) from None


def stop_without_models(gateway: Mapping[str, str], *, seeing: str | None = None, parsing: str | None = None) -> None:
    """Ends the command with one line where a gateway with these settings has no such models, can't load them, or can't
    be started; for commands that ask for hours. The gateway is started for the question alone."""
    if seeing is None and parsing is None:
        return
    try:
        with tempfile.TemporaryDirectory(prefix="logisticsvln-") as logs:
            asyncio.run(interruptible(_check_models(seeing, parsing, gateway, Path(logs))))
    except (CannotFly, BadSetting) as error:
        stop(str(error), WRONG_INPUT)
    except (CannotStart, PortError) as error:
        stop(str(error), FAILED)
    except asyncio.CancelledError:
        stop("interrupted before the first question", INTERRUPTED)


async def _check_models(seeing: str | None, parsing: str | None, gateway: Mapping[str, str], logs: Path) -> None:
    """Raises CannotFly, CannotStart, BadSetting, PortError."""
    environment = process_environment()
    tokens = Connections.read(environment).tokens
    # the oracle asks the simulator when it answers, not before
    oracle = {"ORACLE_SIM_URL": f"http://{HOST}:{PORTS['sim']}"} if seeing == "oracle" else {}
    extra = {"vlm_gateway": oracle | dict(gateway)}
    async with (
        Processes(free_ports(("vlm_gateway",)), logs, environment=environment, extra=extra) as group,
        Services(group.addresses, tokens) as services,
    ):
        if problem := await services.vlm_gateway.token_problem():
            raise CannotFly(f"vlm_gateway {problem}")
        await _find(services, seeing, parsing)

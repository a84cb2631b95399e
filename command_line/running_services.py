"""Whether the services that run take the tokens that are set here: for `logisticsvln doctor`."""

import asyncio
from collections.abc import Mapping
from dataclasses import asdict
from typing import NamedTuple

from contracts.health import Health
from service_kit.addresses import PORTS
from service_kit.client import CallError, Refused, ServiceClient, Unreachable
from service_kit.connections import Connections
from service_kit.settings import secret

ASK_WITHIN_S = 3.0


class Answered(NamedTuple):
    """What one service said; `misfit` is null unless our token is not the one it asks for."""

    service: str
    said: str
    misfit: str | None = None


async def ask_services(environment: Mapping[str, str]) -> list[Answered]:
    """Those of the five that run, each asked at its address. Raises BadSetting."""
    connections = Connections.read(environment)
    addresses = asdict(connections.addresses) | {"orchestrator": f"http://127.0.0.1:{PORTS['orchestrator']}"}
    tokens = connections.tokens._asdict() | {"orchestrator": secret(environment, "ORCHESTRATOR_TOKEN")}
    asked = await asyncio.gather(*(_ask(name, addresses[name], tokens[name]) for name in PORTS))
    return [answered for answered in asked if answered is not None]


async def _ask(service: str, url: str, token: str | None) -> Answered | None:
    async with ServiceClient(service, url, token=token, timeout_s=ASK_WITHIN_S) as client:
        try:
            health = await client.call("GET", "/readyz", Health)
        except Unreachable:
            return None
        except Refused as error:
            return Answered(service, f"{service} at {client.url}: {error.reason}")
        except CallError:
            return Answered(service, f"at {client.url} listens something that is not {service}")
        misfit = await client.token_problem()
        worth = misfit or ("takes our token" if health.access == "granted" else "asks for no token")
        return Answered(service, f"{service} at {client.url} {worth}", misfit)

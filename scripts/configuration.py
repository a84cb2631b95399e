"""Writes docs/configuration.md from the classes that read the settings: `python -m scripts.configuration > FILE`."""

import sys

from orchestrator.settings import OrchestratorSettings
from service_kit.settings import ServiceSettings, Variable
from services.carla_world.settings import CarlaWorldSettings
from services.depth_assist.settings import DepthAssistSettings
from services.llm_parser.settings import LlmParserSettings
from services.mavlink_vehicle.settings import MavlinkVehicleSettings
from services.sim.settings import SimSettings
from services.vlm_gateway.settings import GatewaySettings

SERVICES: dict[str, type[ServiceSettings]] = {
    "orchestrator": OrchestratorSettings,
    "llm_parser": LlmParserSettings,
    "vlm_gateway": GatewaySettings,
    "depth_assist": DepthAssistSettings,
    "sim": SimSettings,
}
OTHER_VEHICLES: dict[str, type[ServiceSettings]] = {
    "mavlink_vehicle": MavlinkVehicleSettings,
    "carla_world": CarlaWorldSettings,
}
"""Started beside them by `serve --vehicle`; no Kubernetes manifest has them."""
HEAD = """\
# Configuration

<!-- Written by `make configuration` from the classes that read these variables. Change those, not this file. -->

Every service reads its settings from environment variables when it starts; all are optional. An empty one counts as not
set. A wrong value ends the start with one line that names the variable and says what would be right; a variable that is
none, but looks as if it was meant to be one, is named in the log.

A **secret** can also be given as a file: with `SIM_TOKEN_FILE=/run/secrets/sim` the value of `SIM_TOKEN` is what that
file holds. A service and its callers read the same `*_TOKEN`, so one environment for all of them fits together; the
orchestrator's `/readyz` finds a token that a service does not accept.

The commands `serve`, `deliver`, `bench`, `evaluate` and `doctor --calibrate` start services of their own. They choose
`HOST`, `PORT`, `PARENT_PID` and the `*_URL` of each, hand everything else of their own environment on, and send the
tokens of `LLM_PARSER_TOKEN`, `GATEWAY_TOKEN`, `DEPTH_ASSIST_TOKEN` and `SIM_TOKEN`. `logisticsvln recording` reads
`CACHE_PATH`, `CACHE_MAX_MB` and `REDIS_URL`. The gateway's models, roles and keys are in the TOML file that
`GATEWAY_CONFIG` names, described in [gateway.md](gateway.md).
"""


def page() -> str:
    """The whole document."""
    common = ServiceSettings.variables()
    parts = [HEAD, _section("Every service", [v for v in common if v.name != "PORT"])]
    parts += [
        _section(f"`{name}`", [v for v in kind.variables() if v not in common])
        for name, kind in (SERVICES | OTHER_VEHICLES).items()
    ]
    return "\n".join(parts)


def _section(title: str, variables: list[Variable] | tuple[Variable, ...]) -> str:
    rows = [f"| {' | '.join(_cells(variable))} |" for variable in variables]
    return "\n".join([f"## {title}", "", "| variable | type | default | meaning |", "|---|---|---|---|", *rows, ""])


def _cells(variable: Variable) -> tuple[str, str, str, str]:
    kind = variable.kind.replace("|", "\\|")
    return f"`{variable.name}`", kind, f"`{variable.default}`" if variable.default else "–", variable.meaning


if __name__ == "__main__":
    sys.stdout.write(page())

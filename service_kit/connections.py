"""Where the services listen and the tokens that open them: what everybody reads who calls one.

A service and its callers read the same variable, so one environment for all of them fits together.
"""

from typing import NamedTuple

from pydantic import Field

from service_kit.addresses import Addresses
from service_kit.settings import HttpAddress, Settings, Token, revealed

TOKEN_VARIABLES = {
    "llm_parser": "LLM_PARSER_TOKEN",
    "vlm_gateway": "GATEWAY_TOKEN",
    "depth_assist": "DEPTH_ASSIST_TOKEN",
    "sim": "SIM_TOKEN",
    "orchestrator": "ORCHESTRATOR_TOKEN",
    "mavlink_vehicle": "MAVLINK_VEHICLE_TOKEN",
    "carla_world": "CARLA_WORLD_TOKEN",
}
"""The variable that holds a service's token."""


class Tokens(NamedTuple):
    """The tokens to send, by service; null where none is set."""

    llm_parser: str | None = None
    vlm_gateway: str | None = None
    depth_assist: str | None = None
    sim: str | None = None


NO_TOKENS = Tokens()
_USUAL = Addresses()


class Connections(Settings):
    """The four services that a mission calls."""

    llm_parser_url: HttpAddress = Field(_USUAL.llm_parser, description="Where llm_parser listens.")
    vlm_gateway_url: HttpAddress = Field(_USUAL.vlm_gateway, description="Where vlm_gateway listens.")
    depth_assist_url: HttpAddress = Field(_USUAL.depth_assist, description="Where depth_assist listens.")
    sim_url: HttpAddress = Field(_USUAL.sim, description="Where the simulator listens.")
    llm_parser_token: Token | None = Field(None, description="The token that llm_parser asks for.")
    gateway_token: Token | None = Field(None, description="The token, or a key, that vlm_gateway asks for.")
    depth_assist_token: Token | None = Field(None, description="The token that depth_assist asks for.")
    sim_token: Token | None = Field(None, description="The token that the simulator asks for.")

    @property
    def addresses(self) -> Addresses:
        return Addresses(
            llm_parser=self.llm_parser_url,
            vlm_gateway=self.vlm_gateway_url,
            depth_assist=self.depth_assist_url,
            sim=self.sim_url,
        )

    @property
    def tokens(self) -> Tokens:
        return Tokens(
            llm_parser=revealed(self.llm_parser_token),
            vlm_gateway=revealed(self.gateway_token),
            depth_assist=revealed(self.depth_assist_token),
            sim=revealed(self.sim_token),
        )

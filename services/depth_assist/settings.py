"""The settings of depth_assist."""

from typing import ClassVar

from pydantic import Field

from service_kit.settings import ServiceSettings, Token


class DepthAssistSettings(ServiceSettings):
    """All optional."""

    prefixes: ClassVar = ("DEPTH_ASSIST_",)

    port: int = Field(8103, ge=1, le=65535, description="The TCP port to listen at.")
    depth_assist_token: Token | None = Field(
        None, description="Callers must send this bearer token; without it all may call."
    )
    depth_assist_max_body_bytes: int = Field(
        64 * 1024 * 1024, ge=1024, le=1 << 30, description="The largest question that is read: five depth pictures."
    )

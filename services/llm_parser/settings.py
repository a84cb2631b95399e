"""The settings of llm_parser."""

from typing import ClassVar, Literal

from pydantic import Field

from service_kit.settings import HttpAddress, ServiceSettings, Token


class LlmParserSettings(ServiceSettings):
    """All optional."""

    prefixes: ClassVar = ("LLM_PARSER_", "PARSER_")

    port: int = Field(8101, ge=1, le=65535, description="The TCP port to listen at.")
    llm_parser_token: Token | None = Field(
        None, description="Callers must send this bearer token; without it all may call."
    )
    llm_parser_max_body_bytes: int = Field(
        64 * 1024, ge=1024, le=1 << 24, description="The largest question that is read: one sentence."
    )
    parser_backend: Literal["reader", "chat"] = Field(
        "reader", description="What reads a request that names no model: the learned reader, or a model of the gateway."
    )
    parser_ground_floor: int = Field(
        1,
        ge=0,
        le=1,
        description="What the ground floor counts as where a request does not show it: 1 (America) or 0 (Europe).",
    )
    parser_model: str | None = Field(
        None, description="The gateway's alias that `chat` asks; unset: the gateway's role `parser`."
    )
    parser_object_language: Literal["english", "request"] = Field(
        "english",
        description="The language in which `chat` names the object: English, as the embedded vision model needs it, or "
        "the request's own, for a vision model that reads it.",
    )
    parser_timeout_s: float = Field(60.0, ge=0.1, le=600.0, description="Seconds that one call of the model may take.")
    parser_max_tokens: int = Field(2048, ge=64, le=32_768, description="The longest answer of the model, in tokens.")
    vlm_gateway_url: HttpAddress = Field("http://127.0.0.1:8102", description="Where vlm_gateway listens.")
    gateway_token: Token | None = Field(None, description="The token, or a key, to send to vlm_gateway.")

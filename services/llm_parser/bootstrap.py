"""Settings of llm_parser, all optional.

`PARSER_BACKEND` is `rules` (the default) or `chat`: what answers a question without a `model`. `GATEWAY_URL`,
`GATEWAY_TOKEN`: the model gateway; `PARSER_MODEL`: the gateway's alias that `chat` asks by
default, else the gateway's role `parser`;
`PARSER_TIMEOUT_S`, `PARSER_MAX_TOKENS`: bounds of one call; `LLM_PARSER_TOKEN`, `MAX_BODY_BYTES`: this service's door.
"""

from fastapi import FastAPI

from service_kit.client import ServiceClient
from service_kit.settings import Settings
from services.llm_parser.app import MAX_BODY_BYTES, Parsers, build_app
from services.llm_parser.chat.backend import ChatParser
from services.llm_parser.port import Parser
from services.llm_parser.rules.backend import RulesParser

DEFAULT_PORT = 8101
DEFAULT_GATEWAY = "http://127.0.0.1:8102"


def bootstrap(settings: Settings) -> FastAPI:
    """The app as the settings want it. Raises BadSetting."""
    backend = settings.choice("PARSER_BACKEND", "rules", ("rules", "chat"))
    max_tokens = settings.integer("PARSER_MAX_TOKENS", 2048, 64, 32_768)
    gateway = ServiceClient(
        "vlm_gateway",
        settings.text("GATEWAY_URL", DEFAULT_GATEWAY) or DEFAULT_GATEWAY,
        timeout_s=settings.number("PARSER_TIMEOUT_S", 60.0, 0.1, 600.0),
        token=settings.text("GATEWAY_TOKEN"),
    )

    def chat(model: str | None) -> ChatParser:
        return ChatParser(gateway, model, max_tokens=max_tokens)

    rules = RulesParser()
    default: Parser = rules if backend == "rules" else chat(settings.text("PARSER_MODEL"))
    return build_app(
        Parsers(rules=rules, default=default, chat=chat),
        about={"backend": backend},
        close=gateway.close,
        token=settings.text("LLM_PARSER_TOKEN"),
        max_body_bytes=settings.integer("MAX_BODY_BYTES", MAX_BODY_BYTES, 1024, 1 << 24),
    )

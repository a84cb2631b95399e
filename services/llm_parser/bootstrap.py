"""Settings in, a wired app out."""

from fastapi import FastAPI

from service_kit.client import ServiceClient
from service_kit.settings import revealed
from services.llm_parser.app import Parsers, build_app
from services.llm_parser.chat.backend import ChatParser
from services.llm_parser.port import Parser
from services.llm_parser.reader.model import ReaderModel
from services.llm_parser.reader.parser import WEIGHTS, ReaderParser
from services.llm_parser.settings import LlmParserSettings


def bootstrap(settings: LlmParserSettings) -> FastAPI:
    """The app as the settings want it."""
    gateway = ServiceClient(
        "vlm_gateway",
        settings.vlm_gateway_url,
        timeout_s=settings.parser_timeout_s,
        token=revealed(settings.gateway_token),
    )

    def chat(model: str | None) -> ChatParser:
        return ChatParser(
            gateway,
            model,
            max_tokens=settings.parser_max_tokens,
            ground_floor=settings.parser_ground_floor,
            object_language=settings.parser_object_language,
        )

    reader = ReaderParser(ReaderModel(WEIGHTS), ground_floor=settings.parser_ground_floor)
    default: Parser = reader if settings.parser_backend == "reader" else chat(settings.parser_model)
    return build_app(
        Parsers(reader=reader, default=default, chat=chat),
        about={"backend": settings.parser_backend},
        close=gateway.close,
        token=revealed(settings.llm_parser_token),
        max_body_bytes=settings.llm_parser_max_body_bytes,
    )

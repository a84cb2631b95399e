"""The grammar behind the service's port."""

import asyncio

from contracts.llm_parser import ParseAnswer
from services.llm_parser.rules.parser import parse

QUICK_CHARACTERS = 1000
"""Longer requests are read in a thread, so that health checks go on being answered."""


class RulesParser:
    """Needs nothing: always ready."""

    async def parse(self, request: str) -> ParseAnswer:
        if len(request) <= QUICK_CHARACTERS:
            return parse(request)
        return await asyncio.to_thread(parse, request)

    async def problem(self) -> str | None:
        return None

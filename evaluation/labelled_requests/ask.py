"""Puts labelled requests to a parser, as a mission does."""

from collections import deque
from collections.abc import Callable, Sequence

from contracts.base import ModelName
from contracts.llm_parser import ParseQuestion
from contracts.orchestrator import ModelCalls
from evaluation.bench.worker_pool import run_workers
from evaluation.labelled_requests.read import FiledRequest
from evaluation.labelled_requests.scores import AskedRequest
from mission.model_calls import CallBook
from mission.ports import ModelUnreachable, Parser


async def ask_parser(
    parser: Parser,
    requests: Sequence[FiledRequest],
    *,
    model: ModelName | None = None,
    at_a_time: int = 1,
    told: Callable[[int], None] = lambda _: None,
) -> list[AskedRequest]:
    """Every request once, `at_a_time` of them together; the answers in the requests' order. `told` hears how many are
    done. Raises PortError, but for a model that is out of reach: such a request has no answer."""
    pending = deque(enumerate(requests))
    answered: dict[int, AskedRequest] = {}

    async def work(_: int) -> None:
        while pending:
            number, filed = pending.popleft()
            answered[number] = await _asked(parser, filed, model)
            told(len(answered))

    await run_workers(work, min(at_a_time, len(requests)))
    return [answered[number] for number in range(len(requests))]


async def _asked(parser: Parser, filed: FiledRequest, model: ModelName | None) -> AskedRequest:
    book, answer = CallBook(), None
    try:
        reply = await book.ask("parser", parser.parse(ParseQuestion(request=filed.request.text, model=model)))
        answer = reply.answer
    except ModelUnreachable:
        pass
    return AskedRequest(filed, answer, book.calls.get("parser", ModelCalls()))

"""One exchange with a caller who speaks Anthropic's messages; what is asked and kept behind it are chats."""

from fastapi.responses import Response
from pydantic_core import to_json

from service_kit.errors import ServiceError
from services.vlm_gateway.anthropic.answer import error_of, message_of, status_of
from services.vlm_gateway.anthropic.request import chat_of
from services.vlm_gateway.anthropic.stream import MessageStream, written
from services.vlm_gateway.upstream.replies import Spent


class MessagesAdapter:
    """`request` first."""

    def __init__(self) -> None:
        self._model = ""
        self._stream: MessageStream | None = None

    def request(self, raw: bytes) -> bytes:
        """The chat that is meant. Raises BadQuestion."""
        chat = chat_of(raw)
        self._model = chat["model"]
        return to_json(chat)

    def answer(self, body: bytes) -> bytes:
        """A whole answer."""
        return to_json(message_of(body, self._model))

    def piece(self, piece: bytes) -> bytes:
        """What of a stream's piece is to be told; may be empty."""
        if self._stream is None:
            self._stream = MessageStream(self._model)
        return self._stream.piece(piece)

    def end(self, used: Spent) -> bytes:
        """The end of a stream that ended well."""
        return b"" if self._stream is None else self._stream.end(used)

    def error(self, error: ServiceError, request_id: str) -> Response:
        body = error_of(error, request_id).model_dump_json()
        return Response(body, status_of(error), error.headers, "application/json")

    def last(self, error: ServiceError, request_id: str) -> bytes:
        """An error as the last event of a stream."""
        told = error_of(error, request_id).model_dump(mode="json")
        return written("error", error=told["error"], request_id=request_id)


class CountAdapter(MessagesAdapter):
    """Whoever asks how long a message is."""

    def answer(self, body: bytes) -> bytes:
        return body

"""What goes back to a caller besides a model's bytes, and what is kept of an answer."""

from typing import NamedTuple, Self

from fastapi.responses import Response

from contracts.errors import ErrorBody, ErrorDetail
from service_kit.errors import ServiceError, error_response


def too_large(limit: int) -> ServiceError:
    """The body is over its bound."""
    message = f"the body is over this route's limit of {limit} bytes; send less"
    return ServiceError(message, code="body_too_large", status=413)


def rendered(error: ServiceError) -> Response:
    """An error as an answer."""
    return error_response(error.status, error.code, error.message, error.details, error.headers)


def event_of(error: ServiceError) -> bytes:
    """An error as the last event of a stream."""
    body = ErrorBody(error=ErrorDetail(code=error.code, message=error.message, details=error.details))
    return b"\n\ndata: " + body.model_dump_json().encode() + b"\n\n"  # first ends whatever line was cut


class Stored(NamedTuple):
    """An answer as it is kept: a line with its kind and its model's alias, then its bytes."""

    alias: str
    stream: bool
    body: bytes

    def written(self) -> bytes:
        return f"{'sse' if self.stream else 'json'} {self.alias}\n".encode() + self.body

    @classmethod
    def read(cls, value: bytes) -> Self | None:
        """None where the bytes are none of ours."""
        line, separator, body = value.partition(b"\n")
        kind, _, alias = line.partition(b" ")
        if not separator or kind not in (b"sse", b"json") or not alias or len(alias) > 80:
            return None
        return cls(alias.decode("ascii", "replace"), kind == b"sse", body)

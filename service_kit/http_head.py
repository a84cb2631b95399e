"""The head of an HTTP/1.1 request."""

from collections.abc import Iterable

_OFFERS = frozenset({b"upgrade", b"http2-settings"})
"""Names of headers and words in `Connection` that offer to change the protocol (RFC 9110, section 7.8)."""


def without_upgrade(first: bytes, headers: Iterable[tuple[bytes, bytes]]) -> bytes:
    """A head of this `first` line and these headers (names in lower case), without what it offers."""
    lines = [first]
    for name, value in headers:
        if name in _OFFERS:
            continue
        if name == b"connection":
            words = (word.strip() for word in value.split(b","))
            value = b", ".join(word for word in words if word.lower() not in _OFFERS)
        if value or name != b"connection":
            lines.append(name + b": " + value)
    return b"\r\n".join(lines) + b"\r\n\r\n"

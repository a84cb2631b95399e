"""Redis' protocol, version 2, as far as a cache needs it: commands out, single replies in."""

from typing import NamedTuple

MAX_REPLY_BYTES = 64 * 1024 * 1024


class Refused(NamedTuple):
    """The server's error; its first word is the kind."""

    message: str


Value = bytes | int | None | Refused


def command(*words: bytes) -> bytes:
    """A command as it goes out."""
    parts = [b"*%d\r\n" % len(words)]
    for word in words:
        parts += (b"$%d\r\n" % len(word), word, b"\r\n")
    return b"".join(parts)


class Replies:
    """Replies out of bytes as they come in, however they are cut."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Value]:
        """All replies that are whole now. Raises ValueError where the bytes are none of Redis'."""
        if self._rest:
            data = self._rest + data
        values: list[Value] = []
        at = 0
        while at < len(data):
            end = data.find(b"\r\n", at)
            if end < 0:
                if len(data) - at > 64 * 1024:
                    raise ValueError("a line without an end")
                break
            kind, line = data[at : at + 1], data[at + 1 : end]
            after = end + 2
            if kind == b"$":
                size = int(line)
                if size > MAX_REPLY_BYTES:
                    raise ValueError(f"a value of {size} bytes")
                if size < 0:
                    values.append(None)
                elif len(data) < after + size + 2:
                    break
                else:
                    values.append(data[after : after + size])
                    after += size + 2
            elif kind == b"+":
                values.append(line)
            elif kind == b":":
                values.append(int(line))
            elif kind == b"-":
                values.append(Refused(line.decode("utf-8", "replace")))
            else:
                raise ValueError(f"a reply of kind {kind!r}")
            at = after
        self._rest = data[at:]
        return values

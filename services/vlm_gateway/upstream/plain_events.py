"""Events of a stream that say one more piece of words and nothing else, known by their bytes.

Nearly all events of a stream are equal but for their words:

    data: {"id":"chatcmpl-1", ... "delta":{"content":" floor"}, ... "finish_reason":null}]}

Once one of them was read in full, whatever has the same bytes before and after a text without quotes, escapes and
control characters would be read to the same, and need not be.
"""

import re
from typing import NamedTuple

MAX_LEARNT = 16
"""Of a server whose events differ elsewhere too (a time, padding by chance) no more is learnt."""
_PLAIN = re.compile(rb'[^"\\\x00-\x1f]+')


class Skimmed(NamedTuple):
    """So many plain events, up to the byte `end`; `passed_on` is what goes on of them, `characters` are their words',
    `blank` where these are spaces alone."""

    events: int
    end: int
    passed_on: bytes
    characters: int
    blank: bool


NOTHING = Skimmed(0, 0, b"", 0, True)


class PlainEvents:
    """Of one stream."""

    def __init__(self) -> None:
        self._before = self._after = self._passed_after = b""
        self._around_characters = 0
        self._learnt = 0

    def learn(self, event: bytes, passed_on: bytes, words: str) -> None:
        """`event` was read: it says `words` and nothing else, and `passed_on` went on of it."""
        if self._learnt == MAX_LEARNT or not words.strip(" ").isalnum() or b"\\" in event or b"\r" in event:
            return
        written = words.encode()
        # in an event without escapes, letters and digits between quotes are a name or a value
        before, quote, after = event.partition(b'"%s"' % written)
        passed_before, _, passed_after = passed_on.partition(b'"%s"' % written)
        one_line = before.startswith(b"data:") and b"\n" not in before and after.find(b"\n") == len(after) - 2
        if not quote or not one_line or b'"%s"' % written in after or passed_before != before:
            return
        self._learnt += 1
        self._before, self._after = before + b'"', b'"' + after
        self._passed_after = self._after if passed_after == after else b'"' + passed_after
        self._around_characters = len((self._before + self._after).decode())

    def skim(self, piece: bytes) -> Skimmed:
        """The plain events at the beginning of `piece`."""
        before, after = self._before, self._after
        if not before:
            return NOTHING
        at = events = 0
        blank = True
        passed_on: list[bytes] = []
        while piece.startswith(before, at) and (words := _PLAIN.match(piece, at + len(before))) is not None:
            end = words.end()
            if not piece.startswith(after, end):
                break
            if after is not self._passed_after:
                passed_on += (piece[at:end], self._passed_after)
            blank = blank and words.group().isspace()
            at = end + len(after)
            events += 1
        if not events:
            return NOTHING
        skimmed = piece[:at]
        try:
            characters = at if skimmed.isascii() else len(skimmed.decode())
        except UnicodeDecodeError:
            return NOTHING
        passed = b"".join(passed_on) or skimmed
        return Skimmed(events, at, passed, characters - events * self._around_characters, blank)

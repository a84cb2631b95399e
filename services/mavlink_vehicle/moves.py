"""The numbered moves of one mission: a number is flown once, however often it is asked for."""

from typing import Literal, NamedTuple

from contracts.geometry import Pose
from contracts.vehicle import Move, MoveProgress, MoveResult
from service_kit.errors import Conflict, NotFound


class _Numbered(NamedTuple):
    """The last numbered move, and what came of it; null while it is flown. `move` is null for a number that was
    cancelled before anybody sent its move."""

    move: Move | None
    result: MoveResult | None
    share: float = 0.0


class Moves:
    """Of one mission; the first number is 1."""

    def __init__(self) -> None:
        self.number = 0
        self._last: _Numbered | None = None

    @property
    def under_way(self) -> bool:
        return self._last is not None and self._last.result is None

    def known(self, number: int, move: Move) -> MoveResult | Literal["under way"] | None:
        """What came of this very move, if it was sent before; null for the next one. Raises Conflict for any other
        number, and for another move under the last one."""
        expected = {"expected": self.number + 1}
        if self._last is not None and number == self.number:
            if self._last.move in (move, None):
                return self._last.result or "under way"
            raise Conflict(
                f"move {number} was already sent with another body; the next move is {self.number + 1}",
                code="move_differs",
                details=expected,
            )
        if number != self.number + 1:
            raise Conflict(
                f"move {number} is out of order; the next move is {self.number + 1}",
                code="move_out_of_order",
                details=expected,
            )
        return None

    def begin(self, number: int, move: Move | None) -> None:
        """That number is flown from now on; without a move, it was cancelled before it was sent."""
        self.number, self._last = number, _Numbered(move, None)

    def flown(self, share: float) -> None:
        """So much of the move under way, 0..1."""
        if self._last is not None and self._last.result is None:
            self._last = self._last._replace(share=max(self._last.share, share))

    def end(self, result: MoveResult) -> None:
        """What came of the move under way."""
        if self._last is None:
            raise RuntimeError("no move was begun")
        share = self._last.share if not result.reached else 1.0
        self._last = _Numbered(self._last.move, result, share)

    def result(self, number: int) -> MoveResult:
        """What came of the last move, which is over. Raises NotFound for any other, Conflict on the way."""
        result = self._numbered(number).result
        if result is None:
            raise Conflict(f"move {number} is under way", code="move_under_way")
        return result

    def progress(self, number: int, pose: Pose) -> MoveProgress:
        """How far the last move has come; `pose`: where the vehicle is. Raises NotFound for any other."""
        numbered = self._numbered(number)
        result = numbered.result
        if result is None:
            return MoveProgress(number=number, state="flying", pose=pose, share=numbered.share)
        state: Literal["done", "cancelled"] = "cancelled" if result.cancelled else "done"
        return MoveProgress(number=number, state=state, pose=result.pose, share=numbered.share)

    def _numbered(self, number: int) -> _Numbered:
        if self._last is None or number != self.number:
            known = f"only the last one, {self.number}, is remembered" if self.number else "none was sent yet"
            raise NotFound(f"there is no move {number}; {known}", code="no_such_move")
        return self._last

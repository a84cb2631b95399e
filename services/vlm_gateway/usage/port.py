"""A store of what was spent: sums by account, and what workers hold of budgets for calls under way.

`tests/agreements/test_usage_stores.py` is its contract. An account is an owner (`key:NAME` or `team:NAME`) in a period
(`2026-11-29` or `2026-11`, UTC). Money is in nano-dollars, so that sums stay exact.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

NANO = 1_000_000_000
HOLD_S = 120.0
"""What a worker holds and does not confirm for so long is free again: the worker has died."""


class UsageDown(Exception):
    """The store can't be used right now; the message says why, without credentials."""


class Account(NamedTuple):
    owner: str
    period: str


class Cost(NamedTuple):
    """What calls cost together, or may cost."""

    tokens: int = 0
    nano_usd: int = 0

    def plus(self, other: "Cost") -> "Cost":
        return Cost(self.tokens + other.tokens, self.nano_usd + other.nano_usd)

    def minus(self, other: "Cost") -> "Cost":
        return Cost(self.tokens - other.tokens, self.nano_usd - other.nano_usd)


class Used(NamedTuple):
    """What calls of one model used."""

    calls: int = 0
    prompt: int = 0
    completion: int = 0
    nano_usd: int = 0

    def plus(self, other: "Used") -> "Used":
        return Used(*(mine + theirs for mine, theirs in zip(self, other, strict=True)))

    @property
    def cost(self) -> Cost:
        return Cost(self.prompt + self.completion, self.nano_usd)


class Charge(NamedTuple):
    account: Account
    model: str
    used: Used


class Batch(NamedTuple):
    """Charges that are added together, once: a worker that does not know whether a batch arrived sends it again under
    its number. A worker's numbers grow."""

    number: int
    charges: tuple[Charge, ...]


class Held(NamedTuple):
    """All that this worker holds of an account from now on."""

    account: Account
    cost: Cost


class Wish(NamedTuple):
    """Room for one more call, `need`, and where there is plenty up to `more` for those that follow. A limit of None
    bounds nothing."""

    account: Account
    most_tokens: int | None
    most_nano_usd: int | None
    need: Cost
    more: Cost


class State(NamedTuple):
    """An account: what was spent, what this worker holds of it, what all workers hold."""

    spent: Cost
    mine: Cost
    held: Cost


class Answer(NamedTuple):
    """The state of every account that was wished for, in order. `refused` is the first that has no room, None where all
    have; then what was needed is held."""

    states: tuple[State, ...]
    refused: int | None


class Row(NamedTuple):
    """What one model used of an account."""

    account: Account
    model: str
    used: Used


class Page(NamedTuple):
    rows: tuple[Row, ...]
    held: dict[Account, Cost]


class UsageStore(Protocol):
    """Every method raises UsageDown where the store can't be used. Other workers and replicas may use the same one."""

    @property
    def place(self) -> str:
        """Where it is, fit to be shown."""

    async def update(self, batch: Batch, held: Sequence[Held], wishes: Sequence[Wish]) -> Answer:
        """All at once or not at all: add the batch if it is not there yet, replace what this worker holds, and hold
        what is wished for if all of it has room. There is room where what is left covers the need, or where something
        is left and nobody holds anything: a call may be larger than a budget's rest, but no two at a time."""

    async def read(self, accounts: Sequence[Account]) -> Page:
        """What was used of these accounts, and what is held of them."""

    async def close(self) -> None: ...


def room(wish: Wish, spent: Cost, held: Cost) -> Cost | None:
    """What is granted of a wish; None where there is no room."""
    granted = []
    for most, used, others, need, more in zip(
        (wish.most_tokens, wish.most_nano_usd), spent, held, wish.need, wish.more, strict=True
    ):
        if most is None or need == 0:
            granted.append(need)
            continue
        free = most - used - others
        if free < need and not (free > 0 and others == 0):
            return None
        granted.append(need + max(0, min(more, (free - need) // 8)))
    return Cost(*granted)

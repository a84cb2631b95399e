"""What bounds a caller's spending: budgets of tokens and money, of its key and its team, by day and by month (UTC)."""

import math
import time
from datetime import UTC, datetime
from enum import Enum
from typing import NamedTuple

from pydantic import Field

from contracts.base import Wire
from service_kit.errors import ServiceError
from services.vlm_gateway.usage.port import NANO

DAY_S = 86_400.0


class Period(Enum):
    DAY = "day"
    MONTH = "month"


class BudgetConfig(Wire):
    """What may be spent, by a key or by a team; what is not given is not bounded."""

    tokens_per_day: int | None = Field(default=None, ge=1, le=10_000_000_000_000)
    tokens_per_month: int | None = Field(default=None, ge=1, le=10_000_000_000_000)
    usd_per_day: float | None = Field(default=None, gt=0.0, le=1_000_000.0)
    usd_per_month: float | None = Field(default=None, gt=0.0, le=1_000_000.0)

    def budgets(self, owner: str) -> tuple["Budget", ...]:
        """Those that are given, of this owner."""
        found = (
            Budget(owner, Period.DAY, (self.tokens_per_day, _nano(self.usd_per_day))),
            Budget(owner, Period.MONTH, (self.tokens_per_month, _nano(self.usd_per_month))),
        )
        return tuple(budget for budget in found if budget.most != (None, None))


class Budget(NamedTuple):
    """`most` of tokens and of nano-dollars; None bounds nothing."""

    owner: str
    period: Period
    most: tuple[int | None, int | None]


class Spender(NamedTuple):
    """Who pays for a call: its key, and its key's team."""

    key: str
    owners: tuple[str, ...]
    budgets: tuple[Budget, ...]


class OverBudget(ServiceError):
    """`code` says which budget: `rate_limited`, `too_many_at_once`, `tokens_spent`, `money_spent`."""

    status = 429

    def __init__(self, message: str, *, code: str, wait_s: float, key: str) -> None:
        seconds = max(1, math.ceil(min(wait_s, 32 * DAY_S)))
        super().__init__(message, code=code, details={"key": key}, headers={"Retry-After": str(seconds)})


def period_of(period: Period, now: float) -> str:
    """`2026-11-29` or `2026-11`."""
    day = _day(int(now // DAY_S))
    return day if period is Period.DAY else day[:7]


def ends_at(period: Period, now: float) -> float:
    """When the period that it is now is over, in seconds since 1970."""
    today = datetime.fromtimestamp(now, UTC)
    if period is Period.DAY:
        return (now // DAY_S + 1) * DAY_S
    year, month = divmod(today.year * 12 + today.month, 12)
    return datetime(year, month + 1, 1, tzinfo=UTC).timestamp()


def over_budget(spender: Spender, budget: Budget, now: float) -> OverBudget:
    """What is told where a budget has no room for a call."""
    kind, _, name = budget.owner.partition(":")
    tokens, nano_usd = budget.most
    limits = [f"{tokens} tokens"] if tokens is not None else []
    limits += [f"{nano_usd / NANO:g} US dollars"] if nano_usd is not None else []
    whose = "this key" if kind == "key" else f"this key's team {name!r}"
    what = (
        f"{whose} may spend {' and '.join(limits)} a {budget.period.value} (UTC), and what is left does not cover this "
        "call beside those under way; GET /v1/usage shows what was spent"
    )
    code = "tokens_spent" if tokens is not None else "money_spent"
    return OverBudget(what, code=code, wait_s=ends_at(budget.period, now) - now, key=spender.key)


def _nano(usd: float | None) -> int | None:
    return None if usd is None else round(usd * NANO)


_days: dict[int, str] = {}


def _day(number: int) -> str:
    """A date by its number of days since 1970; asked for the same one for a day."""
    if number not in _days:
        _days.clear()
        _days[number] = time.strftime("%Y-%m-%d", time.gmtime(number * DAY_S))
    return _days[number]

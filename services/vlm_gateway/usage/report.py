"""What was spent and what is left, for whoever asks."""

import time
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime
from typing import Literal, NamedTuple

from contracts.gateway_usage import BudgetState, ModelUsage, OwnerUsage, UsageReport
from service_kit.errors import Unavailable
from services.vlm_gateway.keys import ANYBODY, Key, Keys
from services.vlm_gateway.usage.budgets import Budget, Period, ends_at, period_of
from services.vlm_gateway.usage.ledger import Ledger
from services.vlm_gateway.usage.port import NANO, Account, Cost, Page, UsageDown


class _Owner(NamedTuple):
    kind: Literal["key", "team"]
    name: str
    team: str | None
    budgets: tuple[Budget, ...]

    @property
    def owner(self) -> str:
        return f"{self.kind}:{self.name}"


async def report(ledger: Ledger, keys: Keys, asking: Key, clock: Callable[[], float] = time.time) -> UsageReport:
    """Of the asking key and its team; an operator's or admin key sees all of them. Raises Unavailable."""
    now = clock()
    owners = _everybody(keys) if asking.admin else _of(keys, asking)
    accounts = [Account(one.owner, period_of(period, now)) for one in owners for period in Period]
    try:
        page = await ledger.page(accounts)
    except UsageDown as error:
        raise Unavailable(f"what was spent can't be read: {error}", code="usage_unavailable") from None
    return UsageReport(owners=tuple(_usage(one, page, now) for one in owners))


def _of(keys: Keys, key: Key) -> list[_Owner]:
    team = key.team
    mine = [_Owner("key", key.name, team, tuple(b for b in key.spender.budgets if b.owner == f"key:{key.name}"))]
    if team is not None:
        mine.append(_team(keys, team))
    return mine


def _everybody(keys: Keys) -> list[_Owner]:
    owners = [_of(keys, key)[0] for key in keys.all or (ANYBODY,)]
    return owners + [_team(keys, name) for name in sorted(keys.teams)]


def _team(keys: Keys, name: str) -> _Owner:
    return _Owner("team", name, None, keys.teams[name].budgets(f"team:{name}"))


def _usage(one: _Owner, page: Page, now: float) -> OwnerUsage:
    used = {period: _models(page, Account(one.owner, period_of(period, now))) for period in Period}
    states = (state for budget in one.budgets for state in _states(budget, page, now))
    return OwnerUsage(
        kind=one.kind,
        name=one.name,
        team=one.team,
        today=used[Period.DAY],
        month=used[Period.MONTH],
        budgets=tuple(states),
    )


def _models(page: Page, account: Account) -> tuple[ModelUsage, ...]:
    return tuple(
        ModelUsage(
            model=row.model,
            calls=row.used.calls,
            prompt_tokens=row.used.prompt,
            completion_tokens=row.used.completion,
            usd=row.used.nano_usd / NANO,
        )
        for row in page.rows
        if row.account == account
    )


def _states(budget: Budget, page: Page, now: float) -> Iterable[BudgetState]:
    account = Account(budget.owner, period_of(budget.period, now))
    spent = _sum([row.used.cost for row in page.rows if row.account == account])
    held = page.held.get(account, Cost())
    resets_at = datetime.fromtimestamp(ends_at(budget.period, now), UTC).isoformat().replace("+00:00", "Z")
    units: tuple[tuple[Literal["tokens", "usd"], int], ...] = (("tokens", 1), ("usd", NANO))
    for (unit, scale), most, used, reserved in zip(units, budget.most, spent, held, strict=True):
        if most is not None:
            yield BudgetState(
                period=budget.period.value,
                unit=unit,
                limit=most / scale,
                spent=used / scale,
                reserved=reserved / scale,
                left=max(0, most - used - reserved) / scale,
                resets_at=resets_at,
            )


def _sum(costs: Sequence[Cost]) -> Cost:
    return Cost(sum(cost.tokens for cost in costs), sum(cost.nano_usd for cost in costs))

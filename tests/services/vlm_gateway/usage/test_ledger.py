"""Budgets in front of a store: exact over workers, kept while it is down, and nothing held by calls that are over."""

import asyncio
import random
from collections.abc import Sequence
from pathlib import Path

import pytest

from services.vlm_gateway.usage.budgets import Budget, BudgetConfig, OverBudget, Period, Spender, ends_at, period_of
from services.vlm_gateway.usage.ledger import Ledger, Reservation
from services.vlm_gateway.usage.port import Account, Answer, Batch, Cost, Held, UsageDown, Used, Wish
from services.vlm_gateway.usage.sqlite import SqliteUsage

NOON = 1_795_953_600.0  # 2026-11-29, 12:00 UTC
DAY = Account("key:a", "2026-11-29")


def spender(tokens: int | None = None, usd: float | None = None, team: int | None = None) -> Spender:
    budgets = BudgetConfig(tokens_per_day=tokens, usd_per_day=usd).budgets("key:a")
    budgets += BudgetConfig(tokens_per_month=team).budgets("team:t")
    return Spender("a", ("key:a", "team:t"), budgets)


class FlakyStore(SqliteUsage):
    """A real store whose connection is cut and mended: before an update arrives, or after."""

    down = False
    loses_answers = False

    async def update(self, batch: Batch, held: Sequence[Held], wishes: Sequence[Wish]) -> Answer:
        if self.down:
            raise UsageDown("down")
        answer = await super().update(batch, held, wishes)
        if self.loses_answers:
            raise UsageDown("the answer was lost")
        return answer


def ledger(path: Path | None = None, worker: str = "one") -> Ledger:
    return Ledger(SqliteUsage(path, worker, clock=lambda: NOON), lambda: None, clock=lambda: NOON)


async def spent(one: Ledger, account: Account = DAY) -> tuple[int, int]:
    """Tokens that were used and tokens that are held."""
    page = await one.page([account])
    return sum(row.used.cost.tokens for row in page.rows), page.held[account].tokens


async def call(one: Ledger, who: Spender, estimate: int, actual: int, takes_s: float = 0.0) -> bool:
    try:
        reservation = await one.reserve(who, Cost(estimate, 0))
    except OverBudget:
        return False
    await asyncio.sleep(takes_s)
    one.settle(reservation, who, "m", Used(1, actual, 0, 0))
    return True


async def test_parallel_calls_never_overdraw_a_budget(tmp_path: Path) -> None:
    workers = [ledger(tmp_path / "usage.sqlite", f"{number}") for number in range(3)]
    who = spender(tokens=1000)
    granted = await asyncio.gather(*(call(workers[n % 3], who, 100, 100, 0.05) for n in range(60)))
    assert sum(granted) == 10
    for worker in workers[1:]:
        await worker.close()
    assert await spent(workers[0]) == (1000, 0)
    for worker in workers[:1]:
        await worker.close()


async def test_a_budget_is_used_up_to_its_last_call_one_after_another() -> None:
    one, who = ledger(), spender(tokens=1000)
    granted = [await call(one, who, 1, 300) for _ in range(6)]
    assert granted == [True] * 4 + [False] * 2
    assert await spent(one) == (1200, 0)  # the last one cost more than it was estimated to
    await one.close()


async def test_a_plentiful_budget_does_not_ask_the_store_for_every_call() -> None:
    asked = 0

    class Counting(SqliteUsage):
        async def update(self, batch: Batch, held: Sequence[Held], wishes: Sequence[Wish]) -> Answer:
            nonlocal asked
            asked += 1
            return await super().update(batch, held, wishes)

    one = Ledger(Counting(None, "one"), lambda: None, clock=lambda: NOON)
    who = spender(tokens=1_000_000_000)
    for _ in range(100):
        assert await call(one, who, 100, 90)
    assert asked <= 15
    assert await spent(one) == (9000, 0)
    await one.close()


async def test_a_team_s_budget_bounds_all_its_keys_and_the_error_says_whose_it_is() -> None:
    one = ledger()
    first = spender(team=100)
    other = Spender("b", ("key:b", "team:t"), first.budgets)
    assert await call(one, first, 60, 60)
    assert await call(one, other, 60, 60)
    with pytest.raises(OverBudget) as refused:
        await one.reserve(other, Cost(60, 0))
    assert "team 't'" in refused.value.message
    assert (refused.value.code, refused.value.status) == ("tokens_spent", 429)
    assert await spent(one, Account("team:t", "2026-11")) == (120, 0)
    await one.close()


async def test_money_runs_out_as_tokens_do() -> None:
    one, who = ledger(), spender(usd=0.01)
    reservation = await one.reserve(who, Cost(10, 9_000_000))
    with pytest.raises(OverBudget) as refused:
        await one.reserve(who, Cost(10, 9_000_000))
    assert refused.value.code == "money_spent"
    one.settle(reservation, who, "m", Used(1, 5, 5, 4_000_000))
    one.settle(await one.reserve(who, Cost(10, 5_000_000)), who, "m", Used(1, 5, 5, 5_000_000))
    page = await one.page([DAY])
    assert page.rows[0].used == Used(2, 10, 10, 9_000_000)
    await one.close()


async def test_a_caller_who_leaves_while_it_asks_for_room_holds_nothing() -> None:
    one, who = ledger(), spender(tokens=1_000)
    rng = random.Random(3)
    for _ in range(200):
        asking = asyncio.create_task(one.reserve(who, Cost(50, 0)))
        await asyncio.sleep(rng.random() * 0.001)
        asking.cancel()
        (result,) = await asyncio.gather(asking, return_exceptions=True)
        if isinstance(result, Reservation):
            one.settle(result, who, "m", Used())
    assert await spent(one) == (0, 0)
    assert await call(one, who, 1000, 1000)
    await one.close()


async def test_while_the_store_is_down_budgets_are_kept_by_what_is_known_and_nothing_is_lost() -> None:
    store, failures = FlakyStore(None, "one"), 0

    def failed() -> None:
        nonlocal failures
        failures += 1

    one = Ledger(store, failed, clock=lambda: NOON)
    who = spender(tokens=1000)
    assert await call(one, who, 100, 600)
    await spent(one)
    store.down = True
    granted = [await call(one, who, 100, 100) for _ in range(10)]
    assert granted.count(True) == 4
    assert one.state == "down"
    assert failures >= 1
    store.down = False
    assert await spent(one) == (1000, 0)
    assert one.state == "ok"
    await one.close()


async def test_a_store_that_hangs_is_waited_for_once_and_looked_after_until_it_is_back() -> None:
    class Hanging(SqliteUsage):
        hangs = False
        asked = 0
        used = asyncio.Event()

        async def update(self, batch: Batch, held: Sequence[Held], wishes: Sequence[Wish]) -> Answer:
            self.asked += 1
            if self.hangs:
                await asyncio.sleep(0.3)
                raise UsageDown("hangs")
            self.used.set()
            return await super().update(batch, held, wishes)

    store = Hanging(None, "one")
    one = Ledger(store, lambda: None, clock=lambda: NOON)
    who = spender(tokens=1000)
    assert await call(one, who, 100, 850)
    await spent(one)
    store.hangs, before = True, store.asked
    assert [await call(one, who, 100, 0) for _ in range(50)] == [True] * 50
    assert one.state == "down"
    assert store.asked - before <= 3  # the call that found it out, and what looks after it
    store.hangs = False
    store.used.clear()
    await asyncio.wait_for(store.used.wait(), 30)
    await one.close()


async def test_an_answer_of_the_store_that_was_lost_charges_nobody_twice() -> None:
    store = FlakyStore(None, "one")
    one, who = Ledger(store, lambda: None, clock=lambda: NOON), spender()
    assert await call(one, who, 10, 100)
    store.loses_answers = True
    assert await spent(one) == (100, 0)  # written, which nobody told the ledger
    assert one.state == "down"
    assert await call(one, who, 10, 11)
    store.loses_answers = False
    for _ in range(2):
        await spent(one)
    assert await spent(one) == (111, 0)
    await one.close()


async def test_what_was_spent_is_written_before_the_service_ends(tmp_path: Path) -> None:
    one = ledger(tmp_path / "usage.sqlite")
    assert await call(one, spender(), 10, 10)
    await one.close()
    other = ledger(tmp_path / "usage.sqlite", "two")
    assert await spent(other) == (10, 0)
    await other.close()


def test_periods_are_days_and_months_of_utc() -> None:
    assert [period_of(period, NOON) for period in Period] == ["2026-11-29", "2026-11"]
    assert ends_at(Period.DAY, NOON) == NOON + 12 * 3600
    assert ends_at(Period.MONTH, NOON) == NOON + 36 * 3600
    assert period_of(Period.MONTH, ends_at(Period.MONTH, NOON)) == "2026-12"
    december = NOON + 20 * 86_400
    assert period_of(Period.MONTH, ends_at(Period.MONTH, december)) == "2027-01"


def test_only_budgets_that_are_given_bound() -> None:
    assert BudgetConfig().budgets("key:a") == ()
    assert BudgetConfig(usd_per_month=1.5).budgets("key:a") == (Budget("key:a", Period.MONTH, (None, 1_500_000_000)),)

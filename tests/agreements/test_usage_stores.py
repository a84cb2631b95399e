"""The contract of stores of usage: what is charged is charged once, and no two workers are promised the same room."""

import asyncio
import uuid
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from services.vlm_gateway.usage.port import (
    HOLD_S,
    Account,
    Batch,
    Charge,
    Cost,
    Held,
    UsageDown,
    UsageStore,
    Used,
    Wish,
)
from services.vlm_gateway.usage.redis import RedisUsage
from services.vlm_gateway.usage.sqlite import SqliteUsage
from tests.conftest import RedisProcess

DAY = Account("key:a", "2026-11-29")
MONTH = Account("team:t", "2026-11")


class Clock:
    def __init__(self) -> None:
        self.now_s = 1_000_000.0

    def __call__(self) -> float:
        return self.now_s


Open = Callable[[str], UsageStore]


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture(params=["sqlite", "redis"])
async def store_of(request: pytest.FixtureRequest, tmp_path: Path, clock: Clock) -> AsyncIterator[Open]:
    """Opens the same store for one worker after another."""
    opened: list[UsageStore] = []
    redis: RedisProcess | None = request.getfixturevalue("redis_server") if request.param == "redis" else None

    def start(worker: str) -> UsageStore:
        if redis is not None:
            opened.append(RedisUsage(redis.url, worker, clock=clock))
        else:
            opened.append(SqliteUsage(tmp_path / "usage.sqlite", worker, clock=clock))
        return opened[-1]

    yield start
    for store in opened:
        await store.close()


def wish(account: Account, most: int | None, need: int, more: int = 0, nano: int = 0, usd: int | None = None) -> Wish:
    return Wish(account, most, usd, Cost(need, nano), Cost(more, 0))


def charge(tokens: int, account: Account = DAY, model: str = "m", nano: int = 0) -> Charge:
    return Charge(account, model, Used(1, tokens - 1, 1, nano))


NONE = Batch(0, ())


async def test_what_is_charged_is_there_for_every_worker_and_after_a_restart(store_of: Open) -> None:
    first = store_of("one")
    await first.update(Batch(1, (charge(10), charge(5, model="n", nano=7), charge(3, MONTH))), (), ())
    await store_of("two").update(Batch(1, (charge(20),)), (), ())
    page = await store_of("three").read([DAY, MONTH])
    assert [(row.account, row.model, row.used) for row in page.rows] == [
        (DAY, "m", Used(2, 28, 2, 0)),
        (DAY, "n", Used(1, 4, 1, 7)),
        (MONTH, "m", Used(1, 2, 1, 0)),
    ]


async def test_a_batch_that_is_sent_again_is_added_once(store_of: Open) -> None:
    store = store_of("one")
    for number in (1, 1, 2, 2, 1):
        await store.update(Batch(number, (charge(10),)), (), ())
    assert (await store.read([DAY])).rows[0].used.calls == 2


async def test_room_is_granted_while_there_is_some_and_refused_with_what_is_in_the_way(store_of: Open) -> None:
    one, two = store_of("one"), store_of("two")
    first = await one.update(NONE, (), [wish(DAY, 100, 60)])
    assert (first.refused, first.states[0].mine) == (None, Cost(60, 0))
    second = await two.update(NONE, (), [wish(MONTH, None, 60), wish(DAY, 100, 60)])
    assert (second.refused, second.states[1].held) == (1, Cost(60, 0))
    assert (await two.read([MONTH])).held[MONTH] == Cost()  # all of a wish or nothing of it
    await one.update(Batch(1, (charge(30),)), [Held(DAY, Cost())], ())
    third = await two.update(NONE, (), [wish(DAY, 100, 60)])
    assert (third.refused, third.states[0].spent) == (None, Cost(30, 0))


async def test_one_call_may_be_larger_than_the_rest_of_a_budget_but_no_two(store_of: Open) -> None:
    one, two = store_of("one"), store_of("two")
    await one.update(Batch(1, (charge(90),)), (), ())
    assert (await one.update(NONE, (), [wish(DAY, 100, 60)])).refused is None
    assert (await two.update(NONE, (), [wish(DAY, 100, 60)])).refused == 0
    await one.update(Batch(2, (charge(60),)), [Held(DAY, Cost())], ())
    assert (await two.update(NONE, (), [wish(DAY, 100, 1)])).refused == 0


async def test_money_and_tokens_bound_each_for_itself(store_of: Open) -> None:
    store = store_of("one")
    await store.update(Batch(1, (charge(10, nano=1000),)), (), ())
    assert (await store.update(NONE, (), [wish(DAY, None, 5, nano=1, usd=1000)])).refused == 0
    assert (await store.update(NONE, (), [wish(DAY, None, 5, nano=0, usd=1000)])).refused is None  # it costs nothing
    assert (await store.update(NONE, (), [wish(DAY, 1000, 5, nano=1, usd=10_000_000_000_000)])).refused is None


async def test_more_than_needed_is_granted_only_where_there_is_plenty(store_of: Open) -> None:
    store = store_of("one")
    plenty = await store.update(NONE, (), [wish(DAY, 1_000_000, 10, 160)])
    assert plenty.states[0].mine == Cost(170, 0)
    scarce = await store.update(NONE, (), [wish(MONTH, 100, 20, 320)])
    assert scarce.states[0].mine == Cost(30, 0)


async def test_what_a_dead_worker_holds_is_free_again_after_a_while(store_of: Open, clock: Clock) -> None:
    one, two = store_of("one"), store_of("two")
    await one.update(NONE, (), [wish(DAY, 100, 100)])
    assert (await two.update(NONE, (), [wish(DAY, 100, 50)])).refused == 0
    clock.now_s += HOLD_S + 1
    assert (await two.update(NONE, (), [wish(DAY, 100, 50)])).refused is None


async def test_of_many_who_ask_at_once_no_more_are_granted_than_there_is_room_for(store_of: Open) -> None:
    stores = [store_of(f"{number}") for number in range(10)]
    answers = await asyncio.gather(*(store.update(NONE, (), [wish(DAY, 100, 30)]) for store in stores))
    assert sum(answer.refused is None for answer in answers) == 3


async def test_a_store_that_is_gone_says_so_without_its_password() -> None:
    store = RedisUsage("redis://:hidden@127.0.0.1:1/0", uuid.uuid4().hex)
    with pytest.raises(UsageDown) as down:
        await store.update(NONE, (), ())
    assert "hidden" not in str(down.value) + store.place
    await store.close()

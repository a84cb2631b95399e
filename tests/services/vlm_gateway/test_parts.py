"""The small parts that everything else leans on: breaker, admission, flights, keys, the guard of the cache."""

import asyncio
from collections.abc import AsyncIterator, Mapping

import pytest

from services.vlm_gateway.admission import Admission
from services.vlm_gateway.breaker import Breaker
from services.vlm_gateway.cache.guard import MAX_PENDING, GuardedCache
from services.vlm_gateway.cache.keys import answer_key
from services.vlm_gateway.cache.port import CacheDown, CacheFull, Entry
from services.vlm_gateway.chat.extract import json_values, without_reasoning
from services.vlm_gateway.errors import ModelOverloaded
from services.vlm_gateway.flights import Flights
from services.vlm_gateway.keys import Key, asking
from services.vlm_gateway.upstream.replies import retry_after_s


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_a_breaker_opens_after_failures_in_a_row_and_lets_one_probe_through() -> None:
    clock = Clock()
    breaker = Breaker(failures=2, pause_s=5.0, clock=clock)
    breaker.failure()
    breaker.success()
    breaker.failure()
    assert breaker.allow()
    breaker.failure()
    assert (breaker.state, breaker.allow(), breaker.wait_s) == ("open", False, 5.0)
    clock.now_s += 5.0
    assert breaker.state == "half_open"
    assert [breaker.allow() for _ in range(3)] == [True, False, False]
    breaker.failure()
    assert not breaker.allow()
    clock.now_s += 5.0
    assert breaker.allow()
    breaker.success()
    assert (breaker.state, breaker.allow()) == ("closed", True)


def test_a_probe_that_is_never_heard_of_does_not_keep_the_breaker_shut() -> None:
    clock = Clock()
    breaker = Breaker(failures=1, pause_s=5.0, clock=clock)
    breaker.failure()
    clock.now_s += 5.0
    assert breaker.allow()
    assert not breaker.allow()
    clock.now_s += 5.0
    assert breaker.allow()


async def test_admission_serves_in_order_and_no_more_than_it_may() -> None:
    admission = Admission("m", concurrency=2, queue=10)
    order: list[int] = []
    most = 0

    async def one(at: int) -> None:
        nonlocal most
        async with admission:
            order.append(at)
            most = max(most, admission.running)
            await asyncio.sleep(0.001)

    await asyncio.gather(*(one(at) for at in range(12)))
    assert order == list(range(12))
    assert (most, admission.running, admission.waiting) == (2, 0, 0)


async def queued(admission: Admission, key: str, served: list[str], refused: list[str]) -> None:
    asking.set(Key(key, None))
    try:
        async with admission:
            served.append(key)
            await asyncio.sleep(0)
    except ModelOverloaded:
        refused.append(key)


async def test_keys_are_served_in_turn_however_much_one_of_them_asks() -> None:
    admission = Admission("m", concurrency=1, queue=100)
    served: list[str] = []
    await admission.enter()
    flood = [asyncio.create_task(queued(admission, "A", served, [])) for _ in range(50)]
    await asyncio.sleep(0)
    others = [asyncio.create_task(queued(admission, key, served, [])) for key in ("B", "C", "B")]
    await asyncio.sleep(0)
    admission.leave()
    await asyncio.gather(*flood, *others)
    assert served[:6] == ["A", "B", "C", "A", "B", "A"]
    assert (len(served), admission.running, admission.waiting) == (53, 0, 0)


async def test_a_flood_that_fills_the_queue_gives_way_to_another_key() -> None:
    admission = Admission("m", concurrency=1, queue=4)
    served: list[str] = []
    refused: list[str] = []
    await admission.enter()
    asks = [asyncio.create_task(queued(admission, key, served, refused)) for key in "AAAAABB"]
    await asyncio.sleep(0.01)
    assert refused == ["A", "A", "A"]  # one too many of its own, and two for B
    assert admission.waiting == 4
    asks.append(asyncio.create_task(queued(admission, "B", served, refused)))
    await asyncio.sleep(0.01)
    assert refused[3:] == ["B"]  # nobody waits for more than B does
    admission.leave()
    await asyncio.gather(*asks)
    assert sorted(served) == ["A", "A", "B", "B"]
    assert (admission.running, admission.waiting) == (0, 0)


async def test_admission_refuses_over_its_queue_and_keeps_its_places_when_callers_give_up() -> None:
    admission = Admission("m", concurrency=1, queue=1)

    async def hold() -> None:
        async with admission:
            await asyncio.sleep(60)

    holding, waiting = asyncio.create_task(hold()), asyncio.create_task(hold())
    await asyncio.sleep(0)
    with pytest.raises(ModelOverloaded):
        async with admission:
            pass
    waiting.cancel()
    await asyncio.gather(waiting, return_exceptions=True)
    assert (admission.running, admission.waiting) == (1, 0)
    waiting = asyncio.create_task(hold())
    await asyncio.sleep(0)
    # the place is handed over and given up in the same breath
    holding.cancel()
    await asyncio.gather(holding, return_exceptions=True)
    waiting.cancel()
    await asyncio.gather(waiting, return_exceptions=True)
    assert (admission.running, admission.waiting) == (0, 0)


async def test_a_flight_goes_on_while_anybody_waits_and_ends_with_the_last() -> None:
    flights: Flights[str] = Flights()
    ended: list[str] = []

    async def work() -> str:
        try:
            await asyncio.sleep(0.05)
        except asyncio.CancelledError:
            ended.append("cancelled")
            raise
        return "done"

    first = asyncio.create_task(flights.share("k", work))
    second = asyncio.create_task(flights.share("k", work))
    await asyncio.sleep(0)
    first.cancel()
    assert await second == ("done", True)
    assert flights.live == 0
    alone = asyncio.create_task(flights.share("k", work))
    await asyncio.sleep(0.01)
    alone.cancel()
    await asyncio.gather(alone, return_exceptions=True)
    await asyncio.sleep(0)
    assert ended == ["cancelled"]
    assert (await flights.share("k", work)).shared is False


async def test_a_flight_s_error_reaches_everybody() -> None:
    flights: Flights[str] = Flights()

    async def work() -> str:
        await asyncio.sleep(0.01)
        raise ModelOverloaded("full")

    results = await asyncio.gather(*(flights.share("k", work) for _ in range(3)), return_exceptions=True)
    assert [type(result) for result in results] == [ModelOverloaded] * 3


def test_a_key_tells_questions_apart_and_does_not_mind_the_order_of_fields() -> None:
    assert answer_key({"a": 1, "b": 2}, [b"x"]) == answer_key({"b": 2, "a": 1}, [b"x"])
    keys = {
        answer_key({"a": 1}),
        answer_key({"a": "1"}),
        answer_key({"a": 1}, [b""]),
        answer_key({"a": 1}, [b"xy"]),
        answer_key({"a": 1}, [b"x", b"y"]),
        answer_key({"a": 1}, [b"y", b"x"]),
    }
    assert len(keys) == 6


class Shelf:
    """A cache in memory whose failures are switched on and off."""

    place = "a shelf"

    def __init__(self) -> None:
        self.held: dict[str, bytes] = {}
        self.down = False
        self.full = False
        self.asked = 0
        self.gate = asyncio.Event()
        self.gate.set()
        self.pinged = asyncio.Event()

    async def get(self, key: str) -> bytes | None:
        self.asked += 1
        if self.down:
            raise CacheDown("down")
        return self.held.get(key)

    async def put(self, answers: Mapping[str, bytes]) -> None:
        await self.gate.wait()
        if self.down:
            raise CacheDown("down")
        if self.full:
            raise CacheFull("full")
        self.held |= answers

    async def entries(self) -> AsyncIterator[Entry]:
        for key, value in list(self.held.items()):
            yield Entry(key, value)

    async def ping(self) -> None:
        if self.down:
            raise CacheDown("down")
        self.pinged.set()

    async def close(self) -> None:
        return


async def test_writing_never_waits_and_what_is_being_written_can_be_read() -> None:
    shelf, failed = Shelf(), list[tuple[str, str]]()
    shelf.gate.clear()
    cache = GuardedCache(shelf, "on", lambda *what: failed.append(what))
    await cache.start()
    for at in range(MAX_PENDING + 5):
        cache.put(str(at), b"v%d" % at)
    assert await cache.get("3") == b"v3"
    assert shelf.held == {}
    assert failed == [("put", "dropped")] * 5
    shelf.gate.set()
    await cache.settled()
    assert len(shelf.held) == MAX_PENDING
    await cache.close()


async def test_after_one_failure_the_store_is_left_alone_until_it_answers_a_probe() -> None:
    shelf = Shelf()
    cache = GuardedCache(shelf, "on", lambda *_: None, probe_every_s=0.02)
    await cache.start()
    shelf.held["k"] = b"v"
    shelf.down = True
    assert [await cache.get("k") for _ in range(5)] == [None] * 5
    assert (shelf.asked, cache.state) == (1, "down")
    shelf.down = False
    await shelf.pinged.wait()
    assert cache.state == "ok"
    assert await cache.get("k") == b"v"
    await cache.close()


async def test_a_full_store_is_still_read() -> None:
    shelf, failed = Shelf(), list[tuple[str, str]]()
    shelf.full, shelf.held = True, {"k": b"v"}
    cache = GuardedCache(shelf, "on", lambda *what: failed.append(what))
    await cache.start()
    cache.put("new", b"x")
    await cache.settled()
    assert (await cache.get("k"), cache.state, failed) == (b"v", "ok", [("put", "full")])
    await cache.close()


async def test_a_replay_writes_nothing_and_says_when_its_store_is_down() -> None:
    shelf = Shelf()
    cache = GuardedCache(shelf, "replay", lambda *_: None)
    await cache.start()
    cache.put("k", b"v")
    await cache.settled()
    assert shelf.held == {}
    shelf.down = True
    for _ in range(2):
        with pytest.raises(CacheDown):
            await cache.get("k")
    await cache.close()


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("<think>a</think>b", "b"),
        ("a</think>b", "b"),
        ("<think>a", ""),
        ("<Thinking>a</Thinking> b <reasoning>c</reasoning>", "b"),
        ("<think>a</think>b<think>c", "b"),
        ("no tags", "no tags"),
        ("1 < 2 and 3 > 2", "1 < 2 and 3 > 2"),
    ],
)
def test_reasoning_is_taken_out(text: str, answer: str) -> None:
    assert without_reasoning(text).answer == answer


def test_the_last_of_several_values_in_prose_is_the_likeliest() -> None:
    assert json_values('first {"a": 1}, better {"a": [{"b": 2}]} so') == [{"a": [{"b": 2}]}, {"a": 1}]
    assert json_values("{" * 5000 + "[" * 5000) == []


@pytest.mark.parametrize(
    ("header", "seconds"),
    [
        ("7", 7.0),
        ("0.5", 0.5),
        ("", None),
        (None, None),
        ("soon", None),
        ("-3", None),
        ("Thu, 01 Jan 1970 00:00:00 GMT", 0.0),
    ],
)
def test_retry_after_is_seconds_or_a_date(header: str | None, seconds: float | None) -> None:
    assert retry_after_s(header) == seconds

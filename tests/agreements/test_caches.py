"""What every cache of answers promises, asked of every implementation."""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from services.vlm_gateway.cache.port import Cache, CacheDown
from services.vlm_gateway.cache.redis import RedisCache
from services.vlm_gateway.cache.sqlite import SqliteCache

KEY, OTHER = "a" * 64, "b" * 64


def make(name: str, where: Any, *, ttl_s: float = 0.0) -> Cache:
    if name == "redis":
        return RedisCache(where.url, ttl_s=ttl_s, timeout_s=5.0)
    return SqliteCache(where / "answers.sqlite", ttl_s=ttl_s, max_bytes=1_000_000)


@pytest.fixture(params=["redis", "sqlite"])
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def where(name: str, request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    return request.getfixturevalue("redis_server") if name == "redis" else tmp_path


@pytest.fixture
async def cache(name: str, where: Any) -> AsyncIterator[Cache]:
    made = make(name, where)
    yield made
    await made.close()


async def test_what_was_never_put_is_not_there(cache: Cache) -> None:
    assert await cache.get(KEY) is None


@pytest.mark.parametrize("value", [b"", b"{}", bytes(range(256)) * 400, "Blumentopf grün".encode()])
async def test_what_was_put_comes_back_byte_for_byte(cache: Cache, value: bytes) -> None:
    await cache.put({KEY: value})
    assert await cache.get(KEY) == value
    assert await cache.get(OTHER) is None


async def test_a_second_put_replaces_the_first(cache: Cache) -> None:
    await cache.put({KEY: b"one"})
    await cache.put({KEY: b"two"})
    assert await cache.get(KEY) == b"two"


async def test_many_are_put_together(cache: Cache) -> None:
    many = {f"{at:064d}": b"%d" % at for at in range(20)}
    await cache.put(many)
    assert {key: await cache.get(key) for key in many} == many


async def test_answers_expire(name: str, where: Any) -> None:
    cache = make(name, where, ttl_s=0.2)
    await cache.put({KEY: b"soon gone"})
    assert await cache.get(KEY) == b"soon gone"
    await asyncio.sleep(0.25)
    assert await cache.get(KEY) is None
    await cache.close()


async def test_answers_outlive_the_process_that_put_them(name: str, where: Any) -> None:
    first = make(name, where)
    await first.put({KEY: b"kept"})
    await first.close()
    second = make(name, where)
    assert await second.get(KEY) == b"kept"
    await second.close()


async def test_two_gateways_share_one_cache(name: str, where: Any, cache: Cache) -> None:
    other = make(name, where)
    await cache.put({KEY: b"mine"})
    assert await other.get(KEY) == b"mine"
    await other.put({KEY: b"yours"})
    assert await cache.get(KEY) == b"yours"
    await other.close()


async def test_many_at_once_do_not_mix(cache: Cache) -> None:
    async def one(at: int) -> None:
        await cache.put({f"{at:064d}": b"%d" % at})
        assert await cache.get(f"{at:064d}") == b"%d" % at

    await asyncio.gather(*(one(at) for at in range(100)))


async def test_it_says_where_it_is_and_that_it_answers(cache: Cache) -> None:
    assert cache.place
    await cache.ping()


async def test_a_closed_or_lost_store_is_down_and_nothing_else(name: str, where: Any, cache: Cache) -> None:
    await cache.put({KEY: b"before"})
    if name == "redis":
        where.stop()
    else:
        await cache.close()
    with pytest.raises(CacheDown):
        await cache.get(KEY)
    with pytest.raises(CacheDown):
        await cache.put({KEY: b"after"})
    with pytest.raises(CacheDown):
        await cache.ping()

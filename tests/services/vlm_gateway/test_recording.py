"""Recordings: out of every cache and into every other, byte for byte; what is damaged is refused as a whole."""

import asyncio
import hashlib
import json
import os
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zstandard

from services.vlm_gateway.cache.guard import MAX_VALUE_BYTES
from services.vlm_gateway.cache.port import Cache, CacheDown
from services.vlm_gateway.cache.redis import RedisCache
from services.vlm_gateway.recording import BadRecording, check, export, read, take_in
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import (
    build,
    chat_backend,
    direction_body,
    find_body,
    floors_body,
    post,
    rows,
    sqlite_cache,
    wait_until,
)
from tests.services.vlm_gateway.openai_mock import OpenAiMock
from tests.services.vlm_gateway.quirky import running

ANSWERS = {
    hashlib.sha256(str(n).encode()).hexdigest(): value
    for n, value in enumerate([b"", b"{}", "grün\n".encode(), bytes(range(256)), b"x" * MAX_VALUE_BYTES])
}


async def filled(cache: Cache) -> Cache:
    for key, value in ANSWERS.items():
        await cache.put({key: value})
    return cache


@pytest.fixture
async def recorded(tmp_path: Path) -> Path:
    cache = await filled(sqlite_cache(tmp_path, "source.sqlite"))
    contents = await export(cache, tmp_path / "run.vlmrec")
    await cache.close()
    assert contents == (len(ANSWERS), sum(map(len, ANSWERS.values())))
    return tmp_path / "run.vlmrec"


async def test_what_was_recorded_comes_back_byte_for_byte(recorded: Path, tmp_path: Path) -> None:
    assert dict(read(recorded)) == ANSWERS
    cache = sqlite_cache(tmp_path, "target.sqlite")
    assert await take_in(recorded, cache) == check(recorded)
    for key, value in ANSWERS.items():
        assert await cache.get(key) == value
    await cache.close()


async def test_a_recording_goes_from_redis_to_a_file_and_into_redis(redis_server: Any, tmp_path: Path) -> None:
    cache = RedisCache(redis_server.url, ttl_s=0, timeout_s=5.0)
    many = {hashlib.sha256(b"%d" % n).hexdigest(): b"answer %d" % n for n in range(600)}
    for key, value in many.items():
        await cache.put({key: value})
    await export(cache, tmp_path / "run.vlmrec")
    assert dict(read(tmp_path / "run.vlmrec")) == many
    redis_server.restart()
    await cache.close()
    empty = RedisCache(redis_server.url, ttl_s=0, timeout_s=5.0)
    await take_in(tmp_path / "run.vlmrec", empty)
    assert {entry.key: entry.value async for entry in empty.entries()} == many
    await empty.close()


def test_a_recording_takes_the_place_of_an_older_one_only_when_it_is_whole(recorded: Path) -> None:
    before = recorded.read_bytes()
    cache = sqlite_cache(recorded.parent, "other.sqlite")

    async def closed_and_exported() -> None:
        await cache.close()
        await export(cache, recorded)

    with pytest.raises(CacheDown, match="is closed"):
        asyncio.run(closed_and_exported())
    assert recorded.read_bytes() == before
    assert not list(recorded.parent.glob("*.part"))


def lines(path: Path) -> list[bytes]:
    return zstandard.ZstdDecompressor().decompressobj().decompress(path.read_bytes()).splitlines(keepends=True)


def packed(path: Path, text: bytes) -> None:
    path.write_bytes(zstandard.ZstdCompressor().compress(text))


def sealed(body: list[bytes], answers: int) -> bytes:
    """With an end that fits whatever is before it."""
    text = b"".join(body)
    end = {"answers": answers, "sha256": hashlib.sha256(text).hexdigest()}
    return text + json.dumps(end).encode() + b"\n"


HEAD = b'{"kind":"vlm_gateway recording","version":1}\n'
GOOD = b'{"key":"%s","text":"{}"}\n' % (b"a" * 64)
DAMAGES: list[tuple[str, Callable[[list[bytes]], bytes], str]] = [
    ("an answer missing", lambda all_: b"".join(all_[:2] + all_[3:]), "damaged"),
    ("an answer changed", lambda all_: b"".join(all_).replace(b'"{}"', b'"[]"'), "damaged"),
    ("two swapped", lambda all_: b"".join([all_[0], all_[2], all_[1], *all_[3:]]), "damaged"),
    ("no end", lambda all_: b"".join(all_[:-1]), "cut short"),
    ("half a line", lambda all_: b"".join(all_)[:-10], "without an end"),
    ("more behind the end", lambda all_: b"".join([*all_, all_[1]]), "behind its end"),
    ("nothing", lambda _: b"", "cut short"),
    ("another version", lambda _: sealed([HEAD.replace(b"1}", b"2}")], 0), "version 2"),
    ("something else", lambda _: b'{"hello": 1}\n', "no recording"),
    ("no JSON", lambda _: sealed([HEAD, b"hello\n"], 1), "line 2 is no JSON"),
    ("a list", lambda _: sealed([HEAD, b"[]\n"], 1), "no JSON object"),
    ("a key that is none", lambda _: sealed([HEAD, GOOD.replace(b"a" * 64, b"../etc")], 1), "line 2 is no answer"),
    ("a further field", lambda _: sealed([HEAD, GOOD[:-2] + b',"ttl":1}\n'], 1), "line 2 is no answer"),
    ("no base64", lambda _: sealed([HEAD, GOOD.replace(b"text", b"base64")], 1), "line 2 is no answer"),
    ("a huge answer", lambda _: sealed([HEAD, GOOD.replace(b"{}", b"x" * (MAX_VALUE_BYTES + 1))], 1), "no answer"),
    ("an endless line", lambda _: b"x" * (4 * MAX_VALUE_BYTES), "without an end"),
]


@pytest.mark.parametrize(("damage", "said"), [d[1:] for d in DAMAGES], ids=[d[0] for d in DAMAGES])
async def test_a_damaged_file_is_refused_and_nothing_of_it_is_kept(
    recorded: Path, tmp_path: Path, damage: Any, said: str
) -> None:
    packed(recorded, damage(lines(recorded)))
    cache = sqlite_cache(tmp_path, "target.sqlite")
    with pytest.raises(BadRecording, match=said):
        await take_in(recorded, cache)
    await cache.close()
    assert rows(tmp_path / "target.sqlite") == 0


def answers_of(path: Path) -> dict[str, bytes] | None:
    """None where the file is refused."""
    try:
        return dict(read(path))
    except BadRecording:
        return None


def test_any_flipped_byte_and_any_cut_is_noticed_or_harmless(recorded: Path) -> None:
    whole = recorded.read_bytes()
    chance = random.Random(3)
    for at in chance.sample(range(len(whole)), 40):
        recorded.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << chance.randrange(8)]) + whole[at + 1 :])
        # a bit of zstd's own that means nothing may be wrong; no answer may
        assert answers_of(recorded) in (None, ANSWERS)
    for at in chance.sample(range(len(whole) - 8), 30):
        recorded.write_bytes(whole[:at])
        assert answers_of(recorded) is None


def test_a_file_that_unpacks_without_end_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "bomb.vlmrec"
    packed(path, b"\0" * 200_000_000)
    assert path.stat().st_size < 50_000
    with pytest.raises(BadRecording, match="without an end"):
        check(path)


def command(*arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    line = [sys.executable, "-m", "services.vlm_gateway.recording", *arguments]
    return subprocess.run(line, env={**os.environ, **environment}, capture_output=True, text=True, timeout=60)


def test_a_run_is_repeated_from_its_recording_without_any_model(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> None:
    questions = {"floor-count": floors_body(), "find-object": find_body(), "choose-direction": direction_body()}
    with running("vllm") as server:
        settings: dict[str, Any] = {"server": "vllm", "base_url": server.url}
        first = serve(build({"m": chat_backend(None, **settings)}, cache=sqlite_cache(tmp_path, "first.sqlite")).app)
        told = {path: post(first, "/v1/" + path, body).json() for path, body in questions.items()}
        wait_until(lambda: rows(tmp_path / "first.sqlite") == 3)
    path = str(tmp_path / "run.vlmrec")
    exported = command("export", path, CACHE_PATH=str(tmp_path / "first.sqlite"))
    assert (exported.returncode, exported.stdout[:10]) == (0, "3 answers,")
    assert command("check", path).returncode == 0
    imported = command("import", path, CACHE_PATH=str(tmp_path / "second.sqlite"))
    assert (imported.returncode, imported.stderr) == (0, "")
    second = sqlite_cache(tmp_path, "second.sqlite")
    replay = serve(build({"m": chat_backend(None, **settings)}, cache=second, mode="replay").app)
    for name, body in questions.items():
        again = post(replay, "/v1/" + name, body).json()
        assert again["cache"] == "hit"
        volatile = {"cache", "latency_s", "attempts"}
        assert {k: v for k, v in again.items() if k not in volatile} == {
            k: v for k, v in told[name].items() if k not in volatile
        }
    assert post(replay, "/v1/floor-count", floors_body(shade=7)).status_code == 404


def test_the_command_says_in_one_line_why_it_can_t(tmp_path: Path) -> None:
    there = str(tmp_path / "answers.sqlite")
    (tmp_path / "bad.vlmrec").write_bytes(b"not zstd")
    for arguments, code, said in [
        (("export", str(tmp_path / "x")), 1, "there is no such cache"),
        (("import", str(tmp_path / "no.vlmrec")), 1, "No such file"),
        (("import", str(tmp_path / "bad.vlmrec")), 1, "is no recording"),
        (("delete", "x"), 2, "usage"),
    ]:
        done = command(*arguments, CACHE_PATH=there)
        assert (done.returncode, done.stderr.count("\n")) == (code, 1)
        assert said in done.stderr


def test_more_than_the_cache_takes_is_refused_before_anything_is_pushed_out(tmp_path: Path) -> None:
    body = [HEAD]
    for n in range(3):
        key = hashlib.sha256(b"%d" % n).hexdigest()
        body.append(json.dumps({"key": key, "text": "x" * 400_000}).encode() + b"\n")
    packed(tmp_path / "big.vlmrec", sealed(body, 3))
    target = tmp_path / "answers.sqlite"
    done = command("import", str(tmp_path / "big.vlmrec"), CACHE_PATH=str(target), CACHE_MAX_MB="1")
    assert (done.returncode, "set CACHE_MAX_MB higher" in done.stderr) == (1, True)
    assert not target.exists()

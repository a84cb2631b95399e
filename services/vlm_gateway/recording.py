"""Recordings: all answers of a cache as one file, and back again, so that a published run is repeated without a model.

    python -m services.vlm_gateway.recording export run.vlmrec     # out of the cache of CACHE_PATH or REDIS_URL
    python -m services.vlm_gateway.recording import run.vlmrec     # into it, kept for ever
    python -m services.vlm_gateway.recording check run.vlmrec

The file is zstd over lines of JSON, which `zstdcat` shows: a head with the version, an answer a line (`key` and
`text`, or `base64` where it is none), and an end with the number of answers and a SHA-256 over every line before. A
file that is damaged, cut short or of another version is refused as a whole, before anything of it is kept.
"""

import asyncio
import contextlib
import hashlib
import io
import json
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

import pybase64
import zstandard

from service_kit.settings import BadSetting, process_environment
from services.vlm_gateway.cache.factory import MEBIBYTE, cache_of, sqlite_place
from services.vlm_gateway.cache.guard import MAX_VALUE_BYTES
from services.vlm_gateway.cache.port import Cache, CacheDown, Entry
from services.vlm_gateway.settings import CacheSettings

KIND, VERSION = "vlm_gateway recording", 1
MAX_LINE_BYTES = 2 * MAX_VALUE_BYTES + 4096
MAX_ANSWERS = 5_000_000
MAX_BYTES = 8 * 1024**3
"""Of all lines together, unpacked."""
WINDOW_BYTES = 8 * 1024 * 1024
_KEY = re.compile(r"[0-9a-f]{64}")


class BadRecording(Exception):
    """A file that is no recording, or a damaged one; the message says what and where."""


class Contents(NamedTuple):
    """`bytes` of the answers alone."""

    answers: int
    bytes: int


async def export(cache: Cache, path: Path) -> Contents:
    """Every answer of `cache` into a new file, which takes the place of `path` when it is whole. Raises CacheDown,
    OSError, or BadRecording where there is more than a recording may hold."""
    with _replacing(path) as file:
        compressor = zstandard.ZstdCompressor(level=6, write_checksum=True)
        with compressor.stream_writer(file, closefd=False) as packed:
            return await _write(cache, packed)


@contextlib.contextmanager
def _replacing(path: Path) -> Iterator[IO[bytes]]:
    """A new file beside `path`, which becomes `path` where all went well and is gone where it did not."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    half = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        half.chmod(0o644)
        half.replace(path)
    except BaseException:
        half.unlink(missing_ok=True)
        raise


async def _write(cache: Cache, packed: zstandard.ZstdCompressionWriter) -> Contents:
    digest = hashlib.sha256()
    answers = held = size = 0

    def line(document: dict[str, Any]) -> bytes:
        return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode() + b"\n"

    def write(text: bytes) -> None:
        nonlocal size
        size += len(text)
        if size > MAX_BYTES or answers > MAX_ANSWERS:
            raise BadRecording(f"the cache holds more than a recording may: {MAX_ANSWERS} answers, {MAX_BYTES} bytes")
        digest.update(text)
        packed.write(text)

    write(line({"kind": KIND, "version": VERSION}))
    seen: set[str] = set()  # Redis may name one twice
    async for entry in cache.entries():
        if entry.key in seen:
            continue
        seen.add(entry.key)
        answers, held = answers + 1, held + len(entry.value)
        try:
            write(line({"key": entry.key, "text": entry.value.decode()}))
        except UnicodeDecodeError:
            write(line({"key": entry.key, "base64": pybase64.b64encode(entry.value).decode("ascii")}))
    packed.write(line({"answers": answers, "sha256": digest.hexdigest()}))
    return Contents(answers, held)


def check(path: Path) -> Contents:
    """Reads all of it and keeps nothing. Raises BadRecording or OSError."""
    answers = held = 0
    for entry in read(path):
        answers, held = answers + 1, held + len(entry.value)
    return Contents(answers, held)


async def take_in(path: Path, cache: Cache) -> Contents:
    """Every answer of the file into `cache`, once all of the file was found sound. Raises BadRecording, CacheDown or
    OSError."""
    contents = check(path)
    for entry in read(path):
        await cache.put({entry.key: entry.value})
    return contents


def read(path: Path) -> Iterator[Entry]:
    """The answers in their order. Raises BadRecording, at the latest after the last one, and OSError."""
    digest = hashlib.sha256()
    answers = size = 0
    ended = False
    for number, text in enumerate(_lines(path), start=1):
        size += len(text)
        if size > MAX_BYTES or answers > MAX_ANSWERS:
            raise BadRecording(f"{path}: more than a recording may hold")
        if ended:
            raise BadRecording(f"{path}: line {number}: there is something behind its end")
        document = _document(path, number, text)
        if number == 1:
            if document.get("kind") != KIND:
                raise BadRecording(f"{path} is no recording of the gateway's")
            if document.get("version") != VERSION:
                raise BadRecording(f"{path} has version {document.get('version')!r}; this gateway reads {VERSION}")
        elif "sha256" in document:
            if document != {"answers": answers, "sha256": digest.hexdigest()}:
                raise BadRecording(f"{path} is damaged: its answers are not those its end speaks of")
            ended = True
        else:
            answers += 1
            yield _entry(path, number, document)
        digest.update(text)
    if not ended:
        raise BadRecording(f"{path} is cut short: its end is missing")


def _lines(path: Path) -> Iterator[bytes]:
    """Lines with their ends, unpacked piece by piece."""
    unpacker = zstandard.ZstdDecompressor(max_window_size=WINDOW_BYTES)
    with path.open("rb") as file:
        try:
            with io.BufferedReader(unpacker.stream_reader(file, read_across_frames=False), 1 << 20) as unpacked:
                while text := unpacked.readline(MAX_LINE_BYTES):
                    if not text.endswith(b"\n"):
                        raise BadRecording(f"{path} is damaged: a line without an end")
                    yield text
        except zstandard.ZstdError as error:
            raise BadRecording(f"{path} is no recording, or a damaged one: {error}") from None


def _document(path: Path, number: int, text: bytes) -> dict[str, Any]:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise BadRecording(f"{path}: line {number} is no JSON") from None
    if not isinstance(document, dict):
        raise BadRecording(f"{path}: line {number} is no JSON object")
    return document


def _entry(path: Path, number: int, document: dict[str, Any]) -> Entry:
    key = document.get("key")
    if isinstance(key, str) and _KEY.fullmatch(key) and len(document) == 2:
        text, packed = document.get("text"), document.get("base64")
        value: bytes | None = None
        if isinstance(text, str):
            value = text.encode("utf-8", "surrogatepass")
        elif isinstance(packed, str):
            try:
                value = pybase64.b64decode(packed, validate=True)
            except ValueError:
                value = None
        if value is not None and len(value) <= MAX_VALUE_BYTES:
            return Entry(key, value)
    raise BadRecording(f"{path}: line {number} is no answer")


async def _main(action: str, path: Path, settings: CacheSettings) -> str:
    if action == "check":
        told = check(path)
        return f"{path} is sound: {told.answers} answers, {told.bytes} bytes"
    place = sqlite_place(settings)
    if action == "import" and place is not None:
        room = settings.cache_max_mb * MEBIBYTE
        needed = check(path).bytes
        if needed > room:
            raise BadRecording(f"{path} holds {needed} bytes, the cache at most {room}: set CACHE_MAX_MB higher")
    if action == "export" and place is not None and not place.exists():
        raise BadSetting(f"CACHE_PATH={place}: there is no such cache to be exported")
    cache = cache_of(settings)
    try:
        told = await (export(cache, path) if action == "export" else take_in(path, cache))
    finally:
        await cache.close()
    way = f"from {cache.place} to {path}" if action == "export" else f"from {path} to {cache.place}"
    return f"{told.answers} answers, {told.bytes} bytes, {way}"


def main(arguments: list[str]) -> int:
    """The command; says on standard error, in one line, why it could not."""
    if len(arguments) != 2 or arguments[0] not in ("export", "import", "check"):
        sys.stderr.write("usage: python -m services.vlm_gateway.recording export|import|check FILE\n")
        return 2
    try:
        # what is taken in is meant to last; the file it came from does
        settings = CacheSettings.read(process_environment() | {"CACHE_TTL_S": "0", "CACHE_TIMEOUT_S": "5"})
        said = asyncio.run(_main(arguments[0], Path(arguments[1]), settings))
    except (BadRecording, BadSetting, CacheDown) as error:
        sys.stderr.write(f"recording: {error}\n")
        return 1
    except OSError as error:
        sys.stderr.write(f"recording: {arguments[1]}: {error.strerror}\n")
        return 1
    sys.stdout.write(said + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

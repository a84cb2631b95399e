"""Which cache the settings mean."""

from pathlib import Path

from service_kit.settings import Settings
from services.vlm_gateway.cache.port import Cache

DEFAULT_CACHE_PATH = "~/.cache/logisticsvln/answers.sqlite"
MEBIBYTE = 1024 * 1024


def sqlite_place(settings: Settings) -> Path | None:
    """The SQLite cache's file; None where the cache is a Redis."""
    if settings.text("REDIS_URL"):
        return None
    return Path(settings.text("CACHE_PATH", DEFAULT_CACHE_PATH) or DEFAULT_CACHE_PATH).expanduser()


def cache_of(settings: Settings) -> Cache:
    """The cache of answers, opened. Raises BadSetting."""
    ttl_s = settings.number("CACHE_TTL_S", 30 * 86_400.0, 0.0, 10 * 365 * 86_400.0)
    path = sqlite_place(settings)
    if path is None:
        from services.vlm_gateway.cache.redis import RedisCache

        timeout_s = settings.number("CACHE_TIMEOUT_S", 0.04, 0.001, 10.0)
        return RedisCache(settings.text("REDIS_URL") or "", ttl_s=ttl_s, timeout_s=timeout_s)
    from services.vlm_gateway.cache.sqlite import SqliteCache

    return SqliteCache(path, ttl_s=ttl_s, max_bytes=settings.integer("CACHE_MAX_MB", 256, 1, 1024 * 1024) * MEBIBYTE)

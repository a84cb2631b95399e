"""Which cache the settings mean."""

from pathlib import Path

from service_kit.settings import revealed
from services.vlm_gateway.cache.port import Cache
from services.vlm_gateway.settings import CacheSettings

MEBIBYTE = 1024 * 1024


def sqlite_place(settings: CacheSettings) -> Path | None:
    """The SQLite cache's file; None where the cache is a Redis."""
    return None if settings.redis_url else settings.cache_path.expanduser()


def cache_of(settings: CacheSettings) -> Cache:
    """The cache of answers, opened. Raises BadSetting."""
    path = sqlite_place(settings)
    if path is None:
        from services.vlm_gateway.cache.redis import RedisCache

        return RedisCache(
            revealed(settings.redis_url) or "", ttl_s=settings.cache_ttl_s, timeout_s=settings.cache_timeout_s
        )
    from services.vlm_gateway.cache.sqlite import SqliteCache

    return SqliteCache(path, ttl_s=settings.cache_ttl_s, max_bytes=settings.cache_max_mb * MEBIBYTE)

"""Which store of usage the settings mean."""

import uuid

from service_kit.settings import revealed
from services.vlm_gateway.settings import GatewaySettings
from services.vlm_gateway.usage.port import UsageStore


def usage_store_of(settings: GatewaySettings) -> UsageStore:
    """The store, opened for this process. Raises BadSetting."""
    worker = uuid.uuid4().hex
    url = revealed(settings.usage_redis_url) or revealed(settings.redis_url)
    if url and settings.usage_path is None:
        from services.vlm_gateway.usage.redis import RedisUsage  # a gateway without it need not load its client

        return RedisUsage(url, worker)
    from services.vlm_gateway.usage.sqlite import SqliteUsage

    path = settings.usage_path or settings.cache_path.with_name("usage.sqlite")
    return SqliteUsage(path.expanduser(), worker)

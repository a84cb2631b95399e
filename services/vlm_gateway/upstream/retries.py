"""When a request to a model's server is made again, and after how long."""

import random
from collections.abc import Container

from service_kit.errors import ServiceError
from services.vlm_gateway.errors import ModelOverloaded

LONGEST_PAUSE_S = 2.0
"""A retry is not put off longer than this; a server that asks for more gets its caller told instead."""
RETRY_SHARE = 0.2
RETRY_RESERVE = 10.0


class RetryBudget:
    """At most one retry in five requests, and ten at once: a server that is down is not asked twice as often."""

    def __init__(self) -> None:
        self.left = RETRY_RESERVE

    def asked(self) -> None:
        self.left = min(RETRY_RESERVE, self.left + RETRY_SHARE)

    def took(self) -> None:
        self.left = max(0.0, self.left - 1.0)


def loading_pause_s(error: ServiceError, attempt: int) -> float:
    """How long to wait for a server that is loading its model."""
    wait_s = min(LONGEST_PAUSE_S, 0.2 * 2.0 ** min(attempt, 8))
    return max(wait_s, float(error.details.get("retry_after_s", 0.0))) + random.uniform(0.05, 0.2)


def retry_pause_s(error: ServiceError, again: int, reasons: Container[str]) -> float | None:
    """How long to wait before asking again; None where that is no use."""
    backoff_s = random.uniform(0.05, 0.2) * 2.0 ** (again - 1)
    if isinstance(error, ModelOverloaded):
        wait_s = float(error.details.get("retry_after_s", 0.0))
        return wait_s + backoff_s if wait_s <= LONGEST_PAUSE_S else None
    if error.details.get("reason") in reasons or error.details.get("upstream_status") == 502:
        return backoff_s
    return None

"""`GET /v1/usage` of the gateway: what a key or a team has spent, and what it may still spend."""

from typing import Literal

from contracts.base import Wire


class ModelUsage(Wire):
    """What calls of one model used; `prompt_tokens` and `completion_tokens` as its server counted them, or estimated
    where it did not."""

    model: str
    calls: int
    prompt_tokens: int
    completion_tokens: int
    usd: float


class BudgetState(Wire):
    """One budget. `reserved` is held by calls under way; `left` is what a new call may still reserve. `resets_at` is in
    UTC, ISO 8601."""

    period: Literal["day", "month"]
    unit: Literal["tokens", "usd"]
    limit: float
    spent: float
    reserved: float
    left: float
    resets_at: str


class OwnerUsage(Wire):
    """A key or a team: what it used today and this month (UTC), by model, and its budgets."""

    kind: Literal["key", "team"]
    name: str
    team: str | None = None
    today: tuple[ModelUsage, ...]
    month: tuple[ModelUsage, ...]
    budgets: tuple[BudgetState, ...]


class UsageReport(Wire):
    """The asking key first and its team after it; an operator gets every key and every team."""

    owners: tuple[OwnerUsage, ...]

"""The bill of one call to a model: reserved by an estimate, settled with what the call used."""

from collections.abc import Mapping
from typing import NamedTuple

from services.vlm_gateway.keys import Key
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.upstream.replies import Spent
from services.vlm_gateway.usage.ledger import UNBOUND, Ledger
from services.vlm_gateway.usage.port import NANO, Cost, Used

BYTES_A_TOKEN = 4
PICTURE_TOKENS = 1000
COMPLETION_TOKENS = 1000
"""Of an answer whose length the caller does not bound."""
_PER_MILLION = 1_000_000


class Price(NamedTuple):
    """US dollars a million tokens."""

    prompt: float = 0.0
    completion: float = 0.0

    def nano_usd(self, tokens: Spent) -> int:
        usd = (tokens.prompt * self.prompt + tokens.completion * self.completion) / _PER_MILLION
        return round(usd * NANO)


NOTHING_USED = Used()


def estimated(text_bytes: int, pictures: int, limit: int | None) -> Spent:
    """What a call may use: `text_bytes` of request without its pictures, `limit` tokens of answer where bounded."""
    prompt = text_bytes // BYTES_A_TOKEN + pictures * PICTURE_TOKENS
    return Spent(max(1, prompt), COMPLETION_TOKENS if limit is None else limit)


class Bill:
    """Settled once; what comes after that changes nothing. `asked` is set when the request goes to the server;
    `is_bounded`: a budget bounds it."""

    __slots__ = ("_accounts", "_key", "_model", "_open", "_reservation", "asked", "estimate", "is_bounded")

    def __init__(self, accounts: "Accounts", key: Key, model: str, estimate: Spent) -> None:
        """Raises OverBudget where the key's tokens of this minute are spent."""
        self.estimate = estimate
        self.asked = False
        self._accounts = accounts
        self._key = key
        self._model = model
        self._reservation = UNBOUND
        self.is_bounded = bool(key.spender.budgets)
        key.hold(estimate.prompt + estimate.completion)
        self._open = True

    async def reserve(self) -> None:
        """Room in the budgets of the key and its team. Raises OverBudget."""
        tokens = self.estimate.prompt + self.estimate.completion
        cost = Cost(tokens, self._accounts.nano_usd(self._model, self.estimate))
        try:
            self._reservation = await self._accounts.ledger.reserve(self._key.spender, cost)
        except BaseException:
            self._open = False
            self._key.settle(tokens, 0)
            raise

    def settle(self, used: Spent) -> None:
        if not self._open:
            return
        self._open = False
        accounts, key, tokens = self._accounts, self._key, used.prompt + used.completion
        key.settle(self.estimate.prompt + self.estimate.completion, tokens)
        if not tokens:
            if self._reservation is not UNBOUND:
                accounts.ledger.settle(self._reservation, key.spender, self._model, NOTHING_USED)
            return
        nano_usd = accounts.nano_usd(self._model, used)
        recorded = Used(1, used.prompt, used.completion, nano_usd)
        accounts.ledger.settle(self._reservation, key.spender, self._model, recorded)
        accounts.metrics.spent(self._model, key.name, used, nano_usd)

    def given_up(self) -> None:
        """The caller left before there was an answer: what the server had read by then is paid for."""
        if self._open:
            self.settle(Spent(prompt=self.estimate.prompt) if self.asked else Spent())


class Accounts:
    """Opens bills. `prices` by alias."""

    def __init__(self, ledger: Ledger, prices: Mapping[str, Price], metrics: GatewayMetrics) -> None:
        self.ledger = ledger
        self.metrics = metrics
        self._prices = dict(prices)

    def adopt(self, prices: Mapping[str, Price]) -> None:
        """From now on these are the prices."""
        self._prices = dict(prices)

    def nano_usd(self, model: str, tokens: Spent) -> int:
        """What so many tokens of a model cost."""
        price = self._prices.get(model)
        return 0 if price is None else price.nano_usd(tokens)

    def usd(self, model: str, tokens: Spent) -> float | None:
        """What a call cost; null where the model has no price or nobody counted its tokens."""
        priced = model in self._prices and tokens.prompt > 0
        return self.nano_usd(model, tokens) / NANO if priced else None

    async def reserve(self, key: Key, model: str, estimate: Spent) -> Bill:
        """Raises OverBudget."""
        bill = self.bill(key, model, estimate)
        if bill.is_bounded:
            await bill.reserve()
        return bill

    def bill(self, key: Key, model: str, estimate: Spent) -> Bill:
        """One for which room is still to be reserved where it is bounded. Raises OverBudget."""
        return Bill(self, key, model, estimate)

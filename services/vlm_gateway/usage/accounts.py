"""The bill of one call to a model: reserved by an estimate, settled with what the call used."""

from collections.abc import Mapping
from typing import NamedTuple

from services.vlm_gateway.keys import Key
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.upstream.replies import Spent
from services.vlm_gateway.usage.ledger import Ledger
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


FREE = Price()


def estimated(text_bytes: int, pictures: int, limit: int | None) -> Spent:
    """What a call may use: `text_bytes` of request without its pictures, `limit` tokens of answer where bounded."""
    prompt = text_bytes // BYTES_A_TOKEN + pictures * PICTURE_TOKENS
    return Spent(max(1, prompt), COMPLETION_TOKENS if limit is None else limit)


class Bill:
    """Settled once; what comes after that changes nothing."""

    def __init__(self, accounts: "Accounts", key: Key, model: str, estimate: Spent) -> None:
        self.estimate = estimate
        self._accounts = accounts
        self._key = key
        self._model = model
        self._open = False
        self.asked = False

    async def reserve(self) -> None:
        """Raises OverBudget."""
        tokens = self.estimate.prompt + self.estimate.completion
        self._key.hold(tokens)
        try:
            nano_usd = self._accounts.price(self._model).nano_usd(self.estimate)
            self._reservation = await self._accounts.ledger.reserve(self._key.spender, Cost(tokens, nano_usd))
        except BaseException:
            self._key.settle(tokens, 0)
            raise
        self._open = True

    def model_asked(self) -> None:
        """The request is on its way to the model's server."""
        self.asked = True

    def settle(self, used: Spent) -> None:
        if not self._open:
            return
        self._open = False
        tokens = used.prompt + used.completion
        nano_usd = self._accounts.price(self._model).nano_usd(used)
        self._key.settle(self.estimate.prompt + self.estimate.completion, tokens)
        recorded = Used(1, used.prompt, used.completion, nano_usd) if tokens else Used()
        self._accounts.ledger.settle(self._reservation, self._key.spender, self._model, recorded)
        self._accounts.metrics.spent(self._model, self._key.name, used, nano_usd)

    def given_up(self) -> None:
        """The caller left before there was an answer: what the server had read by then is paid for."""
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

    def price(self, model: str) -> Price:
        return self._prices.get(model, FREE)

    async def reserve(self, key: Key, model: str, estimate: Spent) -> Bill:
        """Raises OverBudget."""
        bill = Bill(self, key, model, estimate)
        await bill.reserve()
        return bill

"""A web address that is told of every delivery's status: signed as Standard Webhooks has it, and retried.

https://www.standardwebhooks.com: `webhook-id` names the message, the same at every try; `webhook-signature` is
`v1,<base64 of HMAC-SHA256 over "id.timestamp.body">`.
"""

import asyncio
import base64
import hashlib
import hmac
import time
from dataclasses import dataclass
from datetime import UTC, datetime

import aiohttp

from contracts.orchestrator import StatusMessage
from orchestrator.engine import Engine
from orchestrator.records import Records
from orchestrator.store.deliveries import DeliveryStore
from orchestrator.store.upkeep import UpkeepStore

ANSWER_WITHIN_S = 10.0
BATCH = 100


class NotTaken(Exception):
    """The address did not take the message; the engine tries again."""


@dataclass(frozen=True)
class Webhook:
    """Where to, and the secret that signs."""

    url: str
    secret: bytes


class Webhooks:
    """Tells an address as deliveries stand when it is told: of two quick changes only the last."""

    def __init__(self, webhook: Webhook, store: DeliveryStore, records: Records) -> None:
        self._webhook = webhook
        self._store = store
        self._records = records

    async def send(self, message_id: str, name: str) -> None:
        """One message. Raises NotTaken."""
        stored = await asyncio.to_thread(self._store.get, name)
        if stored is None:  # thrown away meanwhile
            return
        delivery = self._records.told(stored)
        message = StatusMessage(type=f"delivery.{stored.status}", timestamp=datetime.now(UTC), data=delivery)
        body = message.model_dump_json().encode()
        headers = signed(self._webhook.secret, message_id, int(time.time()), body)
        timeout = aiohttp.ClientTimeout(total=ANSWER_WITHIN_S)
        try:
            async with (
                aiohttp.ClientSession(timeout=timeout) as session,
                session.post(self._webhook.url, data=body, headers=headers, allow_redirects=False) as answer,
            ):
                if not 200 <= answer.status < 300:
                    raise NotTaken(f"the webhook answered {answer.status}")
        except (aiohttp.ClientError, TimeoutError) as error:
            raise NotTaken(f"the webhook can't be reached ({type(error).__name__})") from None


async def tell_untold(store: UpkeepStore, engine: Engine) -> None:
    """Hands the engine a message for every delivery whose status nobody has been told."""
    untold = await asyncio.to_thread(store.untold, BATCH)
    if untold:
        await engine.tell([(f"{one.id}.{one.status}.{one.version}", one.id) for one in untold])
        await asyncio.to_thread(store.told, untold)


def signed(secret: bytes, message_id: str, timestamp: int, body: bytes) -> dict[str, str]:
    """The message's headers."""
    text = f"{message_id}.{timestamp}.".encode() + body
    signature = base64.b64encode(hmac.new(secret, text, hashlib.sha256).digest()).decode()
    return {
        "content-type": "application/json",
        "webhook-id": message_id,
        "webhook-timestamp": str(timestamp),
        "webhook-signature": f"v1,{signature}",
    }

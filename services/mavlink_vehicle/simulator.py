"""The simulator's episodes of a trial: what is drawn, and who judges."""

import asyncio
import secrets
from contextlib import suppress

from contracts.sim import Claim, Episode, EpisodeQuestion, Verdict
from service_kit.client import CallError, Refused, ServiceClient
from service_kit.errors import ServiceError, Unavailable

LEASE_S = 60.0
DEADLINE_S = 50.0


class Simulator:
    """`client`: of its service."""

    def __init__(self, client: ServiceClient) -> None:
        self.client = client

    async def close(self) -> None:
        await self.client.close()

    async def begin(self, question: EpisodeQuestion) -> Episode:
        """An episode of that scene; one that is not waited for to the end is freed by its key. Raises what the
        simulator refuses, and Unavailable."""
        key = secrets.token_hex(16)
        asked = question.model_copy(update={"key": key, "owner": None, "lease_s": LEASE_S})
        try:
            return await self.client.call("POST", "/v1/episodes", Episode, asked, timeout_s=DEADLINE_S)
        except Refused as error:
            if error.status < 500:
                raise ServiceError(error.reason, code=error.code, status=error.status, details=error.details) from None
            raise Unavailable(f"no scene: {error}", code="no_scene") from None
        except CallError as error:
            await self._free(f"/v1/episodes?key={key}")
            raise Unavailable(f"no scene: {error}", code="no_scene") from None
        except asyncio.CancelledError:
            await self._free(f"/v1/episodes?key={key}")
            raise

    async def claim(self, episode_id: str, claim: Claim) -> Verdict:
        """Raises CallError."""
        return await self.client.call("POST", f"/v1/episodes/{episode_id}/claim", Verdict, claim, timeout_s=DEADLINE_S)

    async def end(self, episode_id: str) -> None:
        await self._free(f"/v1/episodes/{episode_id}")

    async def _free(self, path: str) -> None:
        """Asked for; where nobody answers, the lease ends it."""
        with suppress(CallError):
            await self.client.delete(path)

"""The deliveries that this process carries on: what the engine calls for each step, and what ends them early."""

import asyncio
import logging
import time

from sqlalchemy.exc import DBAPIError

from contracts.events import new_event
from contracts.orchestrator import DeliveryResult
from mission.record import failed
from orchestrator.intake import Intake
from orchestrator.store.deliveries import DeliveryStore, Ending, StoredDelivery, Superseded
from orchestrator.turns import Tools, Turn
from orchestrator.watch import Watch

log = logging.getLogger("orchestrator.carrier")

TROUBLE_PAUSE_S = 2.0
"""After that a step is done again for which the database or the record's folder was away."""


class Carrier:
    """`executor` names this process."""

    def __init__(self, tools: Tools, watch: Watch, intake: Intake, executor: str) -> None:
        self._tools = tools
        self._watch = watch
        self._intake = intake
        self._executor = executor
        self._turns: dict[str, Turn] = {}

    @property
    def _store(self) -> DeliveryStore:
        return self._tools.store

    async def carry_on(self, name: str, number: int) -> bool:
        """One step of that turn; false when it is over."""
        try:
            turn = self._turns.get(name) or await self._take_up(name, number)
            if turn is not None and turn.on_the_ground:
                await self._intake.let_pass()
            if turn is not None and await turn.step():
                return True
        except Superseded:
            log.warning("delivery %s is carried on by another process", name)
            self._turns.pop(name, None)
            await asyncio.Event().wait()  # nothing may be recorded of this turn: it is the other's
        except (DBAPIError, OSError) as error:
            log.error("delivery %s can't be carried on now: %s", name, error)
            self._turns.pop(name, None)
            await asyncio.sleep(TROUBLE_PAUSE_S)
            return True
        except Exception as error:
            log.exception("delivery %s broke off", name)
            await self._give_up(name, error)
        finally:
            self._watch.note(name)
        self._turns.pop(name, None)
        return False

    def end_soon(self, name: str, reason: Ending) -> None:
        """A delivery carried on here is to end."""
        turn = self._turns.get(name)
        if turn is not None:
            turn.end(reason)

    async def close(self, within_s: float) -> None:
        """Steps under way have so long, and are then left as they are: drones hold."""
        give_up = time.monotonic() + within_s
        for turn in list(self._turns.values()):
            await turn.leave(give_up - time.monotonic())

    async def _take_up(self, name: str, number: int) -> Turn | None:
        stored = await asyncio.to_thread(self._store.take_up, name, number, self._executor)
        if stored is None:
            return None
        turn = await asyncio.to_thread(Turn, stored, self._tools)
        self._turns[name] = turn
        return turn

    async def _give_up(self, name: str, error: Exception) -> None:
        """A delivery that this program can't carry on ends as `failed`."""
        stored = await asyncio.to_thread(self._store.get, name)
        if stored is None or stored.status == "done":
            return
        result = failed(f"it can't be carried on: {type(error).__name__}: {error}"[:500])
        await asyncio.to_thread(self._store.commit, name, stored.version, _ended(result), [_last(stored, result)])


def _ended(result: DeliveryResult) -> dict[str, object]:
    over = {"status": "done", "phase": "done", "ended": time.time(), "executor": None, "due": None, "state": None}
    return over | {"open_question": None, "result": result.model_dump_json()}


def _last(stored: StoredDelivery, result: DeliveryResult) -> tuple[int, str]:
    event = new_event(
        result,
        number=stored.events + 1,
        time_s=round(time.time() - (stored.begun or stored.created), 3),
        phase="done",
        message=f"{result.outcome}: {result.message}",
    )
    return event.number, event.model_dump_json()

"""The durable engine, DBOS Transact: queues of turns, and turns that another process takes over.

A turn of a delivery is one workflow, and each of its steps one step of the workflow. A step's recorded output is only
whether there is another one: what it did stands in the deliveries' tables, in one transaction. So a step that was done
and not recorded is, when it is done again, the next one.
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence

from dbos import DBOS, DBOSClient, DBOSConfig, EnqueueOptions, StepOptions

from contracts.fleet import VehicleKind
from contracts.orchestrator import MAX_PRIORITY
from orchestrator.store.database import Database
from orchestrator.store.deliveries import StoredDelivery, mark_queued

CarryOn = Callable[[str, int], Awaitable[bool]]
"""One step of that turn of a delivery; false when the turn is over."""

Send = Callable[[str, str], Awaitable[None]]
"""Sends the message of that id about that delivery; raises where it was not taken."""

APPLICATION = "logisticsvln"
TURN = "turn"
MESSAGE = "message"
MESSAGES_AT_A_TIME = 8
TRIES: StepOptions = {
    "name": "send",
    "retries_allowed": True,
    "interval_seconds": 1.0,
    "backoff_rate": 2.0,
    "max_attempts": 12,
}
"""For a bit more than an hour."""
WORKFLOWS_VERSION = "1"
"""Of the workflows' form: a delivery queued by a program of the same version is carried on after an upgrade."""
BATCH = 200
FIRST_AGE = 1_767_225_600.0
"""2026-01-01 in seconds since 1970."""
AGE_STEP_S = 4.0
AGES = 200_000_000
"""25 years of them, for each priority; the engine's numbers end at 2**31 - 1."""
SETTLE_S = 0.5
"""Far longer than the engine takes to write down a step that has ended."""
REQUESTS_AT_A_TIME = 8
"""Requests that one process reads at a time."""


class Engine:
    """One a process: DBOS keeps its own in globals."""

    def __init__(
        self, database: Database, executor: str, carry_on: CarryOn, poll_s: float, send: Send | None = None
    ) -> None:
        """`poll_s`: the time between two looks at a queue."""
        self._send = send or _sent_to_nobody
        self._database = database
        self._executor = executor
        self._carry_on = carry_on
        self._poll_s = poll_s
        self._room: dict[VehicleKind, int] = {}
        self._client = DBOSClient(system_database_engine=database.engine, application_name=APPLICATION, lazy=True)
        self._running = False
        self._held = False

    async def launch(self, room: Mapping[VehicleKind, int]) -> None:
        """Begins to work off the queues; `room`: deliveries that each kind of vehicle may fly at a time, over all
        processes. Workflows run in the calling event loop."""
        config: DBOSConfig = {
            "name": APPLICATION,
            "system_database_url": self._database.url.render_as_string(hide_password=False),
            "system_database_engine": self._database.bookkeeping,
            "executor_id": self._executor,
            "application_version": WORKFLOWS_VERSION,
            "log_level": "ERROR",
            "console_log_level": "ERROR",
            "enable_otlp": False,
            "max_executor_threads": 16,
            "use_listen_notify": False,
            # nobody waits for the engine's notifications: its thread only has to hear soon that it is to end
            "notification_listener_polling_interval_sec": 0.1,
            "scheduler_polling_interval_sec": 3600.0,
        }
        DBOS(config=config)

        @DBOS.workflow(name=TURN, max_recovery_attempts=None)
        async def turn(delivery: str, number: int) -> None:
            while await DBOS.run_step_async({"name": "step"}, self._step, delivery, number):
                pass

        @DBOS.workflow(name=MESSAGE, max_recovery_attempts=None)
        async def message(message_id: str, name: str) -> None:
            await DBOS.run_step_async(TRIES, self._message, message_id, name)

        DBOS.launch()
        self._running = True
        await DBOS.register_queue_async(
            "request", worker_concurrency=REQUESTS_AT_A_TIME, polling_interval_sec=self._poll_s
        )
        await DBOS.register_queue_async("prompt", polling_interval_sec=self._poll_s)
        await DBOS.register_queue_async(
            MESSAGE, worker_concurrency=MESSAGES_AT_A_TIME, polling_interval_sec=2 * self._poll_s
        )
        await self.set_room(room)

    async def _step(self, delivery: str, number: int) -> bool:
        await self._hold()
        more = await self._carry_on(delivery, number)
        await self._hold()
        return more

    async def _message(self, message_id: str, name: str) -> None:
        await self._hold()
        await self._send(message_id, name)
        await self._hold()

    async def _hold(self) -> None:
        """Where the engine is held, nothing goes on from here: what a step did is done, and not recorded."""
        if self._held:
            await asyncio.Event().wait()

    async def set_room(self, room: Mapping[VehicleKind, int]) -> None:
        """From now on each kind of vehicle may fly so many at a time."""
        for kind, number in room.items():
            if self._room.get(kind) != number:
                self._room[kind] = number
                await DBOS.register_queue_async(kind, global_concurrency=number, polling_interval_sec=self._poll_s)

    async def queue(self, turns: Sequence[StoredDelivery]) -> None:
        """Queues the due turns of these deliveries, in one transaction; one that is queued already is not queued
        again."""
        await asyncio.to_thread(self._queue, turns)

    def _queue(self, turns: Sequence[StoredDelivery]) -> None:
        with self._database.engine.begin() as transaction:
            for stored in turns:
                options: EnqueueOptions = {
                    "workflow_name": TURN,
                    "queue_name": stored.lane,
                    "workflow_id": workflow_id(stored.id, stored.turn),
                    "app_version": WORKFLOWS_VERSION,
                    "priority": rank(stored.priority, stored.created),
                }
                self._client.enqueue_in_transaction(transaction, options, stored.id, stored.turn)
            mark_queued(transaction, turns)

    async def take_over(self, dead: Sequence[str]) -> None:
        """Turns that were begun by processes that have died are queued again, and go on at the step that they had come
        to; a turn that somebody has taken over already stays with them."""
        await asyncio.to_thread(DBOS._recover_pending_workflows, list(dead))

    async def has(self, stored: StoredDelivery) -> bool:
        """Is that delivery's turn queued or under way?"""
        status = await DBOS.get_workflow_status_async(workflow_id(stored.id, stored.turn))
        return status is not None and status.status in ("ENQUEUED", "PENDING")

    async def tell(self, messages: Sequence[tuple[str, str]]) -> None:
        """Sends these messages, by their ids, of these deliveries; one that was handed over already is not sent
        again."""
        await asyncio.to_thread(self._tell, messages)

    def _tell(self, messages: Sequence[tuple[str, str]]) -> None:
        for message_id, name in messages:
            options: EnqueueOptions = {
                "workflow_name": MESSAGE,
                "queue_name": MESSAGE,
                "workflow_id": message_id,
                "app_version": WORKFLOWS_VERSION,
            }
            DBOS.enqueue_workflow_with_options(options, message_id, name)

    async def forget_finished(self) -> None:
        """Deletes what the engine has recorded of turns that are over: the deliveries' tables say all of it."""
        while True:
            over = await DBOS.list_workflows_async(
                status=["SUCCESS", "ERROR", "CANCELLED"], limit=BATCH, load_input=False, load_output=False
            )
            await DBOS.delete_workflows_async([workflow.workflow_id for workflow in over])
            if len(over) < BATCH:
                return

    def hold(self) -> None:
        """No further step begins, and what those under way come to is not recorded: they are another process's."""
        self._held = True

    async def close(self) -> None:
        """Turns that are not over stay as they are, to be taken over. No workflow may need the engine's threads after
        this: it is held first, and what it is writing is written."""
        self.hold()
        if self._running:
            self._running = False
            await asyncio.sleep(SETTLE_S)
            await asyncio.to_thread(DBOS.destroy, destroy_registry=True, workflow_completion_timeout_sec=0)


async def _sent_to_nobody(message_id: str, name: str) -> None:
    """For messages that were handed over while there was a webhook."""


def rank(priority: int, created: float) -> int:
    """The engine's priority, of which the lowest goes first: by the delivery's own, then by its age, however often it
    was queued. Of ages the engine's numbers tell steps of `AGE_STEP_S` apart."""
    age = min(max(0, int((created - FIRST_AGE) // AGE_STEP_S)), AGES - 1)
    return 1 + (MAX_PRIORITY - priority) * AGES + age


def workflow_id(delivery: str, turn: int) -> str:
    return f"{delivery}.{turn}"

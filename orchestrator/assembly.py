"""An orchestrator put together: its database, its engine, and what they carry."""

import asyncio
import os
import uuid
from functools import partial

from orchestrator.adoption import Adoption
from orchestrator.carrier import Carrier
from orchestrator.deliveries import Bounds, Deliveries
from orchestrator.engine import Engine
from orchestrator.hangar import Hangar
from orchestrator.intake import Intake
from orchestrator.keeper import Keeper
from orchestrator.order_form import OrderForm
from orchestrator.overview import Overlook
from orchestrator.record_files import FolderFiles
from orchestrator.records import Records
from orchestrator.retention import Keep, Retention
from orchestrator.roll_call import RollCall
from orchestrator.store.database import Database
from orchestrator.store.deliveries import DeliveryStore
from orchestrator.store.executors import ExecutorStore
from orchestrator.store.lines import LineStore
from orchestrator.store.upkeep import UpkeepStore
from orchestrator.store.vehicles import VehicleStore
from orchestrator.streets import Streets
from orchestrator.telemetry import Telemetry
from orchestrator.turns import Policy, Tools
from orchestrator.watch import Watch
from orchestrator.webhooks import Webhook, Webhooks, tell_untold

ASK_VEHICLES_EVERY_S = 5.0
CLEAR_EVERY_S = 300.0
TELL_EVERY_S = 1.0
ADOPT_EVERY_S = 15.0
LEAVE_WITHIN_S = 3.0
"""How long steps under way have to end by themselves when the process ends."""


class Orchestrator:
    """One process's share of the deliveries in a database."""

    def __init__(
        self,
        database: Database,
        hangar: Hangar,
        records: Records,
        policy: Policy,
        bounds: Bounds,
        *,
        lost_after_s: float = 10.0,
        poll_s: float = 0.5,
        webhook: Webhook | None = None,
        keep: Keep | None = None,
    ) -> None:
        """`lost_after_s`: how long another process is waited for before its deliveries are taken over; `poll_s`: the
        time between two looks at a queue."""
        executor = f"{os.uname().nodename[:40]}-{os.getpid()}-{uuid.uuid4().hex[:8]}"
        store = DeliveryStore(database.engine)
        self._vehicles = VehicleStore(database.engine)
        self._database = database
        # other programs write into a folder, and never into a bucket
        self._adoption = Adoption(records.files.runs, store) if isinstance(records.files, FolderFiles) else None
        self._records = records
        self._watch = Watch(store)
        intake = Intake(store)
        tools = Tools(store, self._vehicles, hangar, records, policy)
        self._carrier = Carrier(tools, self._watch, intake, executor)
        self._upkeep = UpkeepStore(database.engine)
        self._retention = Retention(self._upkeep, records, keep or Keep())
        self._webhooks = None if webhook is None else Webhooks(webhook, store, records)
        send = None if self._webhooks is None else self._webhooks.send
        self._engine = Engine(database, executor, self._carrier.carry_on, poll_s, send)
        self.fleet = RollCall(hangar, self._vehicles, self._engine)
        self.order_form = OrderForm(hangar, self.fleet)
        self._keeper = Keeper(
            store,
            ExecutorStore(database.engine),
            self._engine,
            intake,
            self._carrier,
            executor,
            alone=not database.shared,
            lost_after_s=lost_after_s,
        )
        lines = LineStore(database.engine)
        self.deliveries = Deliveries(store, intake, lines, self._watch, self._keeper, hangar, records, bounds)
        self.overlook = Overlook(self.deliveries, lines, self.fleet, Telemetry(hangar, store), Streets(store))

    async def start(self) -> None:
        """Takes up what is there, and what comes."""
        await self.fleet.register()
        await self._adopt()
        await self._engine.launch(await asyncio.to_thread(self._vehicles.room))
        await self._keeper.start()
        self._keeper.every(ADOPT_EVERY_S, self._adopt)
        self._keeper.every(ASK_VEHICLES_EVERY_S, self.fleet.call)
        self._keeper.every(CLEAR_EVERY_S, partial(asyncio.to_thread, self._retention.clear))
        if self._webhooks is not None:
            self._keeper.every(TELL_EVERY_S, partial(tell_untold, self._upkeep, self._engine))

    async def _adopt(self) -> None:
        if self._adoption is not None:
            await asyncio.to_thread(self._adoption.adopt)

    async def usable(self) -> str | None:
        """What is wrong with the database; null when all is well."""
        return await asyncio.to_thread(self._database.problem)

    async def keeps_records(self) -> str | None:
        """Why records can't be kept; null when all is well."""
        return await asyncio.to_thread(self._records.files.problem)

    async def close(self) -> None:
        """What is under way is left for another process, or for this one when it is started again."""
        self._engine.hold()
        await self._carrier.close(LEAVE_WITHIN_S)
        await self._watch.close()
        await self._keeper.close()
        await self._engine.close()
        self._database.close()  # the engine has taken the loop's threads along

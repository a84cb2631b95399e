"""Budgets of tokens and money: a call reserves what it may cost before it starts, and is charged what it did cost.

What is spent lies in a store that workers and replicas share. Asking it for every call would make calls slow, so a
worker takes room for a few calls at a time where there is plenty, and call by call where a budget runs out; what was
spent is written every fifth of a second, and room that is not used is given back then. A store that is down fails no
call, and none but the one that finds it out waits for it: budgets are kept by what was last known, and what is spent is
written once the store is back.
"""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Coroutine, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

from service_kit.running_loop import running_loop
from services.vlm_gateway.usage.budgets import Budget, Period, Spender, over_budget, period_of
from services.vlm_gateway.usage.port import (
    HOLD_S,
    Account,
    Batch,
    Charge,
    Cost,
    Held,
    Page,
    State,
    UsageDown,
    UsageStore,
    Used,
    Wish,
)

log = logging.getLogger(__name__)
FLUSH_EVERY_S = 0.2
RETRY_EVERY_S = 1.0
CALLS_AT_ONCE = 16
"""Room for so many more calls like this one is taken where there is plenty."""
_NOTHING = Cost()


class Reservation(NamedTuple):
    """What a call holds of the budgets that bound it until it is settled."""

    accounts: tuple[Account, ...]
    cost: Cost


UNBOUND = Reservation((), _NOTHING)
"""Of a caller whom no budget bounds."""


class _Room:
    """What this worker knows of one account: `granted` is held at the store, `in_use` of it by calls under way;
    `unwritten` was spent since the store was told."""

    __slots__ = ("granted", "in_use", "spent", "unwritten")

    def __init__(self) -> None:
        self.granted = self.in_use = self.unwritten = self.spent = _NOTHING

    def fits(self, cost: Cost) -> bool:
        left = self.granted.minus(self.in_use).minus(self.unwritten)
        return cost.tokens <= left.tokens and cost.nano_usd <= left.nano_usd

    def fits_by_what_is_known(self, budget: Budget, cost: Cost) -> bool:
        """Without the store: whether a budget has room as far as this worker knows."""
        used = self.spent.plus(self.unwritten).plus(self.in_use)
        for most, so_far, running, need in zip(budget.most, used, self.in_use, cost, strict=True):
            if most is not None and need and so_far + need > most and not (so_far < most and running == 0):
                return False
        return True


class Ledger:
    """`failed` is told of every failure of the store. `close` writes what is not written yet."""

    def __init__(self, store: UsageStore, failed: Callable[[], None], clock: Callable[[], float] = time.time) -> None:
        self._store = store
        self._failed = failed
        self._clock = clock
        self._rooms: dict[Account, _Room] = {}
        self._unwritten: dict[tuple[Spender, str], list[int]] = {}
        self._batch = Batch(0, ())
        self._one_at_a_time = asyncio.Lock()
        self._tasks: set[asyncio.Task[None]] = set()
        self._timer: asyncio.TimerHandle | None = None
        self._down = False

    @property
    def place(self) -> str:
        return self._store.place

    @property
    def state(self) -> str:
        return "down" if self._down else "ok"

    async def reserve(self, spender: Spender, cost: Cost) -> Reservation:
        """Room for a call in every budget that bounds it. Raises OverBudget."""
        if not spender.budgets:
            return UNBOUND
        now = self._clock()
        accounts = tuple(Account(budget.owner, period_of(budget.period, now)) for budget in spender.budgets)
        reservation = Reservation(accounts, cost)
        if self._taken(reservation):
            return reservation
        if self._down:
            self._take_by_what_is_known(spender, reservation, now)
        else:
            # a task of its own: a caller who leaves now must not leave behind an update of which nobody knows
            task = self._start(self._ask(spender, reservation, now))
            try:
                await asyncio.shield(task)
            except asyncio.CancelledError:
                task.add_done_callback(partial(self._given_up, reservation))
                raise
        return reservation

    def settle(self, reservation: Reservation, spender: Spender, model: str, used: Used) -> None:
        """The call is over, and this is what it used."""
        for account in reservation.accounts:
            room = self._rooms[account]
            room.in_use = room.in_use.minus(reservation.cost)
        if used.calls:
            sums = self._unwritten.get((spender, model))
            if sums is None:
                sums = self._unwritten[spender, model] = [0] * len(used)
            sums[0] += used.calls
            sums[1] += used.prompt
            sums[2] += used.completion
            sums[3] += used.nano_usd
            for account in reservation.accounts:
                self._rooms[account].unwritten = self._rooms[account].unwritten.plus(used.cost)
        if self._timer is None:
            self._later(RETRY_EVERY_S if self._down else FLUSH_EVERY_S)

    async def page(self, accounts: Sequence[Account]) -> Page:
        """What was used, this moment's calls of this worker included. Raises UsageDown."""
        await asyncio.shield(self._start(self._flushed()))
        return await self._store.read(accounts)

    async def close(self) -> None:
        """Waits for at most two seconds for the store."""
        if self._timer is not None:
            self._timer.cancel()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(2.0):
                while self._unwritten or self._batch.charges or self._tasks:
                    await self._flushed()
                    await asyncio.sleep(0.01)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        if self._timer is not None:
            self._timer.cancel()
        with contextlib.suppress(UsageDown):
            await self._store.close()

    def _start(self, work: Coroutine[Any, Any, None]) -> "asyncio.Task[None]":
        task = running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def _given_up(self, reservation: Reservation, asked: "asyncio.Task[None]") -> None:
        """Whoever asked for room has left before there was an answer."""
        if not asked.cancelled() and asked.exception() is None:
            self.settle(reservation, Spender("", (), ()), "", Used())

    def _taken(self, reservation: Reservation) -> bool:
        """Whether there was room in what this worker holds already."""
        rooms = [self._rooms.get(account) for account in reservation.accounts]
        if not all(room is not None and room.fits(reservation.cost) for room in rooms):
            return False
        self._use(reservation)
        return True

    def _use(self, reservation: Reservation) -> None:
        for account in reservation.accounts:
            room = self._rooms[account]
            room.in_use = room.in_use.plus(reservation.cost)

    async def _ask(self, spender: Spender, reservation: Reservation, now: float) -> None:
        """Raises OverBudget."""
        async with self._one_at_a_time:
            if self._taken(reservation):
                return  # somebody else asked for more than was needed
            if self._down:
                self._take_by_what_is_known(spender, reservation, now)
                return
            cost = reservation.cost
            more = Cost(cost.tokens * CALLS_AT_ONCE, cost.nano_usd * CALLS_AT_ONCE)
            bounds = list(zip(reservation.accounts, spender.budgets, strict=True))
            for account in reservation.accounts:
                self._rooms.setdefault(account, _Room())
            try:
                refused = await self._write([Wish(account, *budget.most, cost, more) for account, budget in bounds])
            except UsageDown:
                self._take_by_what_is_known(spender, reservation, now)
                return
            if refused is not None:
                raise over_budget(spender, spender.budgets[refused], now)
            self._use(reservation)

    def _take_by_what_is_known(self, spender: Spender, reservation: Reservation, now: float) -> None:
        """Without the store. Raises OverBudget."""
        for account, budget in zip(reservation.accounts, spender.budgets, strict=True):
            if not self._rooms.setdefault(account, _Room()).fits_by_what_is_known(budget, reservation.cost):
                raise over_budget(spender, budget, now)
        self._use(reservation)

    async def _write(self, wishes: Sequence[Wish] = ()) -> int | None:
        """Tell the store what was spent and is still held, and ask for what is wished for; which of that is refused.
        To be called by one at a time. Raises UsageDown."""
        if not self._batch.charges:  # else it is not known whether the last one was written: it is sent again as it is
            self._batch = Batch(self._batch.number + 1, tuple(self._charges()))
            self._unwritten = {}
        held = []
        for account, room in self._rooms.items():
            if room.granted != _NOTHING or room.in_use != _NOTHING:
                room.granted = room.in_use  # what is not in use is given back, and nobody takes it meanwhile
                held.append(Held(account, room.in_use))
        try:
            answer = await self._store.update(self._batch, held, wishes)
        except UsageDown as error:
            self._lost(error)
            raise
        self._down = False
        for charge in self._batch.charges:
            if (known := self._rooms.get(charge.account)) is not None:
                known.unwritten = known.unwritten.minus(charge.used.cost)
                known.spent = known.spent.plus(charge.used.cost)
        self._batch = Batch(self._batch.number, ())
        for wish, state in zip(wishes, answer.states, strict=True):
            self._knows(wish.account, state)
        return answer.refused

    def _charges(self) -> Iterator[Charge]:
        """What is not written yet, by account: for every owner, in the day and the month that it is."""
        now = self._clock()
        periods = [period_of(period, now) for period in Period]
        for (spender, model), sums in self._unwritten.items():
            for owner in spender.owners:
                for period in periods:
                    yield Charge(Account(owner, period), model, Used(*sums))

    def _knows(self, account: Account, state: State) -> None:
        self._rooms[account].granted, self._rooms[account].spent = state.mine, state.spent

    def _later(self, after_s: float) -> None:
        if self._timer is None:
            self._timer = running_loop().call_later(after_s, self._flush)

    def _flush(self) -> None:
        self._timer = None
        self._start(self._flushed())

    async def _flushed(self) -> None:
        async with self._one_at_a_time:
            with contextlib.suppress(UsageDown):
                await self._write()
        if self._down:
            self._later(RETRY_EVERY_S)
        elif self._unwritten:
            self._later(FLUSH_EVERY_S)
        elif any(room.in_use != _NOTHING for room in self._rooms.values()):
            self._later(HOLD_S / 4)  # calls that take long keep what they hold
        else:
            now = {period_of(period, self._clock()) for period in Period}
            self._rooms = {account: room for account, room in self._rooms.items() if account.period in now}

    def _lost(self, error: UsageDown) -> None:
        self._failed()
        if not self._down:
            log.warning("usage can't be written, budgets are kept by what is known: %s", error)
        self._down = True
        self._later(RETRY_EVERY_S)

"""Usage in Redis, for workers and replicas on several machines. One script does each update, so that none sees half of
another."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from redis.asyncio import Redis
from redis.exceptions import RedisError

from service_kit.settings import BadSetting, without_password
from services.vlm_gateway.usage.port import (
    HOLD_S,
    Account,
    Answer,
    Batch,
    Charge,
    Cost,
    Held,
    Page,
    Row,
    State,
    UsageDown,
    Used,
    Wish,
)

PREFIX = "vlm_gateway:usage:1:"
KEPT_S = 400 * 86_400
_COUNTS = ("calls", "prompt", "completion", "nano_usd")
TIMEOUT_S = 1.0

_UPDATE = """
local asked, now = cjson.decode(ARGV[1]), tonumber(ARGV[2])
local function whole(number) return string.format('%.0f', number) end
local function total(name, field) return tonumber(redis.call('HGET', name, field) or '0') end
local function holds(name)
  local mine, all = {0, 0}, {0, 0}
  local found = redis.call('HGETALL', name)
  for at = 1, #found, 2 do
    local tokens, nano, till = string.match(found[at + 1], '^(%-?%d+) (%-?%d+) ([%d.]+)$')
    if tonumber(till) > now then
      all[1], all[2] = all[1] + tonumber(tokens), all[2] + tonumber(nano)
      if found[at] == asked.worker then mine = {tonumber(tokens), tonumber(nano)} end
    else
      redis.call('HDEL', name, found[at])
    end
  end
  return mine, all
end
local function hold(name, tokens, nano)
  if tokens == 0 and nano == 0 then
    redis.call('HDEL', name, asked.worker)
  else
    redis.call('HSET', name, asked.worker, whole(tokens) .. ' ' .. whole(nano) .. ' ' .. ARGV[3])
    redis.call('EXPIRE', name, asked.kept_s)
  end
end
if #asked.charges > 0 then
  local last = asked.prefix .. 'batch:' .. asked.worker
  if tonumber(redis.call('GET', last) or '0') >= asked.batch then asked.charges = {} end
  redis.call('SET', last, whole(asked.batch), 'EX', 86400)
end
for _, charge in ipairs(asked.charges) do
  for field, amount in pairs(charge.amounts) do redis.call('HINCRBY', charge.name, field, whole(amount)) end
  redis.call('EXPIRE', charge.name, asked.kept_s)
end
for _, one in ipairs(asked.held) do hold(one.name, one.cost[1], one.cost[2]) end
local states, grants, refused = {}, {}, -1
for at, wish in ipairs(asked.wishes) do
  local spent = {total(wish.name, 'tokens'), total(wish.name, 'nano_usd')}
  local mine, all = holds(wish.holds)
  local grant = {0, 0}
  for unit = 1, 2 do
    local most, need = wish.most[unit], wish.need[unit]
    if most < 0 or need == 0 then
      grant[unit] = need
    else
      local free = most - spent[unit] - all[unit]
      if free < need and not (free > 0 and all[unit] == 0) then
        if refused < 0 then refused = at - 1 end
      else
        grant[unit] = need + math.max(0, math.min(wish.more[unit], math.floor((free - need) / 8)))
      end
    end
  end
  states[at], grants[at] = {spent = spent, mine = mine, held = all}, grant
end
if refused < 0 then
  for at, wish in ipairs(asked.wishes) do
    local state, grant = states[at], grants[at]
    for unit = 1, 2 do
      state.mine[unit], state.held[unit] = state.mine[unit] + grant[unit], state.held[unit] + grant[unit]
    end
    hold(wish.holds, state.mine[1], state.mine[2])
  end
end
return cjson.encode({states = states, refused = refused})
"""


class RedisUsage:
    """`worker` tells this process apart from the others that use the same Redis. Budgets want a Redis that evicts
    nothing (`maxmemory-policy noeviction`)."""

    def __init__(self, url: str, worker: str, *, clock: Callable[[], float] = time.time) -> None:
        """Raises BadSetting where `url` is not a Redis address."""
        self._shown = without_password(url)
        self._worker = worker
        self._clock = clock
        try:
            self._redis: Redis = Redis.from_url(
                url, socket_timeout=TIMEOUT_S, socket_connect_timeout=TIMEOUT_S, decode_responses=True
            )
        except ValueError as error:
            raise BadSetting(f"USAGE_REDIS_URL={self._shown}: {error}; give redis://host:6379/0") from None
        self._script = self._redis.register_script(_UPDATE)

    @property
    def place(self) -> str:
        return self._shown

    async def update(self, batch: Batch, held: Sequence[Held], wishes: Sequence[Wish]) -> Answer:
        asked = {
            "worker": self._worker,
            "kept_s": KEPT_S,
            "prefix": PREFIX,
            "batch": batch.number,
            "charges": [{"name": _name(one.account), "amounts": _amounts(one)} for one in batch.charges],
            "held": [{"name": _holds(one.account), "cost": list(one.cost)} for one in held],
            "wishes": [
                {
                    "name": _name(wish.account),
                    "holds": _holds(wish.account),
                    "most": [-1 if most is None else most for most in (wish.most_tokens, wish.most_nano_usd)],
                    "need": list(wish.need),
                    "more": list(wish.more),
                }
                for wish in wishes
            ],
        }
        now = self._clock()
        try:
            told = json.loads(await self._script(args=[json.dumps(asked), f"{now:.3f}", f"{now + HOLD_S:.3f}"]))
        except (RedisError, OSError) as error:
            raise UsageDown(f"{self._shown}: {type(error).__name__}") from None
        states = tuple(State(_cost(one["spent"]), _cost(one["mine"]), _cost(one["held"])) for one in told["states"])
        return Answer(states, None if told["refused"] < 0 else int(told["refused"]))

    async def read(self, accounts: Sequence[Account]) -> Page:
        pipeline = self._redis.pipeline(transaction=False)
        for account in accounts:
            pipeline.hgetall(_name(account))
            pipeline.hgetall(_holds(account))
        try:
            found = await pipeline.execute()
        except (RedisError, OSError) as error:
            raise UsageDown(f"{self._shown}: {type(error).__name__}") from None
        rows: list[Row] = []
        held: dict[Account, Cost] = {}
        for account, used, holds in zip(accounts, found[::2], found[1::2], strict=True):
            rows += _rows(account, used)
            live = [line.split(" ") for line in holds.values()]
            held[account] = Cost(
                *(sum(int(line[at]) for line in live if float(line[2]) > self._clock()) for at in (0, 1))
            )
        return Page(tuple(rows), held)

    async def close(self) -> None:
        await self._redis.aclose()


def _name(account: Account) -> str:
    return f"{PREFIX}{account.owner}:{account.period}"


def _holds(account: Account) -> str:
    return f"{_name(account)}:held"


def _amounts(charge: Charge) -> dict[str, int]:
    """The fields of an account's hash that a charge adds to: its totals, and its model's own counts."""
    amounts = {"tokens": charge.used.cost.tokens, "nano_usd": charge.used.nano_usd}
    amounts |= {f"{name}:{charge.model}": count for name, count in zip(_COUNTS, charge.used, strict=True)}
    return {name: amount for name, amount in amounts.items() if amount}


def _rows(account: Account, fields: Mapping[str, str]) -> list[Row]:
    models = sorted({name.partition(":")[2] for name in fields if ":" in name})
    return [Row(account, model, Used(*(int(fields.get(f"{name}:{model}", 0)) for name in _COUNTS))) for model in models]


def _cost(pair: Sequence[Any]) -> Cost:
    return Cost(int(pair[0]), int(pair[1]))

"""`python -m tests.load.gateway_soak --minutes 60`: cancels, stalls, resets and half-sent bodies; then, what is left?

A gateway process between this one, which is callers and model server in one (`soak_model.py`). Three keys ask at
random:

    steady   reads every answer to its end, whatever the server does with it (reset, cut, stall, error, 429); what that
             has to cost is worked out here, to the token
    leaver   leaves: before, in and after the head of the answer, in the middle of a stream, by FIN and by RST, with
             half a head or half a body sent, or with one that it never ends; asks twice on one connection
    sharer   asks what others ask in the same moment, through the cache; some of them leave

Afterwards nothing may be held: places at the model and of keys, connections, file descriptors, reserved budget; memory
must not grow with the requests; what was charged to `steady` must be what it had to cost; and the usage store and the
figures must agree for all keys. The code is 1 where something is.
"""

import argparse
import asyncio
import collections
import gc
import hashlib
import json
import os
import random
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import httpx

from services.vlm_gateway.usage.accounts import estimated
from tests.load import soak_model
from tests.load.gateway_peers import ROOT, resident_mb
from tests.load.processes import free_port

KEYS = ("steady", "leaver", "sharer")
OPERATOR = "soak-operator-token"
TIMEOUT_S = 2.0
LONGEST_S = 30.0
PLACES = 16
KEY_PLACES = 64
MAX_TOKENS = 64
MB_A_THOUSAND = 0.5
"""Memory may grow by so much a thousand requests, once warm: what a slope cannot be told from over an hour."""
STEADY = ("whole", "stream", "slow", "refuse", "busy", "crash", "reset", "cut", "stall", "streamcut", "streamstall")
STEADY_SHARES = (30, 30, 6, 4, 3, 3, 4, 4, 2, 6, 3)
LEAVES = ("whole", "stream", "slow", "stall", "streamstall", "halfhead", "halfbody", "neverbody", "twice", "garbage")


class Sample(NamedTuple):
    """The gateway's memory after so many requests."""

    requests: int
    resident_mb: float


class Answered(NamedTuple):
    """`status` 0 where there was none."""

    status: int
    body: bytes


class Soak:
    """`asked` requests so far; `wanted` tokens (prompt, completion) that `steady` has to be charged."""

    def __init__(self, port: int, seed: int) -> None:
        self._port = port
        self._rng = random.Random(seed)
        self.asked = 0
        self.deeds: collections.Counter[str] = collections.Counter()
        self.statuses: collections.Counter[str] = collections.Counter()
        self.wanted = [0, 0]
        self.odd: list[str] = []

    async def one(self) -> None:
        """A request of one of the keys."""
        self.asked += 1
        who = self._rng.choices(KEYS, (50, 40, 10))[0]
        try:
            async with asyncio.timeout(LONGEST_S):
                await {"steady": self._steady, "leaver": self._leaver, "sharer": self._sharer}[who]()
        except TimeoutError:
            self.odd.append(f"a request of {who} was not over after {LONGEST_S:g} s")

    def request(self, key: str, deed: str, number: int, nonce: str, **more: object) -> bytes:
        messages = [{"role": "user", "content": f"{deed} {number} {nonce}"}]
        body: dict[str, object] = {"model": "mock", "messages": messages, "max_tokens": MAX_TOKENS, **more}
        if deed in ("slow", *(name for name in (*STEADY, *LEAVES) if name.startswith("stream"))):
            body["stream"] = True
        raw = json.dumps(body).encode()
        head = f"POST /v1/chat/completions HTTP/1.1\r\nhost: 127.0.0.1\r\nauthorization: Bearer soak-{key}\r\n"
        return f"{head}content-type: application/json\r\ncontent-length: {len(raw)}\r\n\r\n".encode() + raw

    async def _steady(self) -> None:
        deed = self._rng.choices(STEADY, STEADY_SHARES)[0]
        number = self._rng.randint(1, 40)
        request = self.request("steady", deed, number, f"{self._rng.random()}")
        answered = await self._exchange(request)
        self.deeds[deed] += 1
        self.statuses[f"{deed} {answered.status}"] += 1
        self._charge(request, answered)

    def _charge(self, request: bytes, answered: Answered) -> None:
        """What that has to cost."""
        if answered.status == 0:
            self.odd.append("an answer of steady broke off")
        if answered.status != 200:
            return
        body = answered.body
        if not body.startswith(b"data:"):
            counted = json.loads(body)["usage"]
            self.wanted[0] += counted["prompt_tokens"]
            self.wanted[1] += counted["completion_tokens"]
            return
        words = body.count(b'"content": "w')
        if b"data: [DONE]" in body:
            self.wanted[0] += soak_model.PROMPT_TOKENS
        else:
            text_bytes = len(request.split(b"\r\n\r\n", 1)[1])
            self.wanted[0] += estimated(text_bytes, 0, MAX_TOKENS).prompt
        self.wanted[1] += words

    async def _sharer(self) -> None:
        deed = self._rng.choice(["whole", "stream", "slow"])
        request = self.request("sharer", deed, self._rng.randint(1, 40), f"{self._rng.random()}", temperature=0)
        self.deeds["shared"] += 1
        callers = [
            self._leave_within(request, self._rng.random() * 0.3) if self._rng.random() < 0.5 else self._read(request)
            for _ in range(5)
        ]
        await asyncio.gather(*callers)

    async def _leaver(self) -> None:
        deed = self._rng.choice(LEAVES)
        self.deeds[f"leave {deed}"] += 1
        request = self.request("leaver", deed if deed in STEADY else "whole", 30, f"{self._rng.random()}")
        if deed == "halfhead":
            await self._leave_within(request[: self._rng.randint(1, 60)], self._rng.random())
        elif deed == "halfbody":
            await self._leave_within(request[: -self._rng.randint(1, 60)], self._rng.random())
        elif deed == "neverbody":
            await self._exchange(request[: -self._rng.randint(1, 60)])
        elif deed == "twice":
            await self._leave_within(request + request, self._rng.random() * 0.2)
        elif deed == "garbage":
            await self._exchange(self._rng.randbytes(200))
        else:
            await self._leave_within(request, self._rng.random() * 0.8)

    async def _read(self, request: bytes) -> None:
        if (answered := await self._exchange(request)).status not in (200, 503):
            self.odd.append(f"a sharer who stayed got {answered.status}")

    async def _leave_within(self, sent: bytes, seconds: float) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
        try:
            writer.write(sent)
            async with asyncio.timeout(seconds):
                while await reader.read(self._rng.choice([10, 65536])):
                    pass
        except (TimeoutError, OSError):
            pass
        finally:
            if self._rng.random() < 0.5:  # by RST
                line = writer.get_extra_info("socket")
                line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            writer.close()

    async def _exchange(self, request: bytes) -> Answered:
        """The whole answer, its chunks put together."""
        try:
            reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
        except OSError:
            return Answered(0, b"")
        try:
            writer.write(request)
            head = (await reader.readuntil(b"\r\n\r\n")).lower()
            status = int(head.split(b" ", 2)[1])
            if b"transfer-encoding: chunked" not in head:
                length = int(head.split(b"content-length: ", 1)[1].split(b"\r\n", 1)[0])
                return Answered(status, await reader.readexactly(length))
            pieces = []
            while size := int(await reader.readline(), 16):
                pieces.append((await reader.readexactly(size + 2))[:-2])
            return Answered(status, b"".join(pieces))
        except (OSError, asyncio.IncompleteReadError):
            return Answered(0, b"")
        finally:
            writer.close()


class Gateway:
    """The process that is soaked."""

    def __init__(self, folder: Path, model_port: int) -> None:
        keys = "".join(
            f'[keys.{name}]\nsha256 = "{hashlib.sha256(f"soak-{name}".encode()).hexdigest()}"\n'
            f"concurrency = {KEY_PLACES}\ntokens_per_month = 100000000\ntokens_per_minute = 100000000\nteam = 'all'\n\n"
            for name in KEYS
        )
        (folder / "gateway.toml").write_text(
            f'[models.mock]\nbackend = "chat"\nbase_url = "http://127.0.0.1:{model_port}/v1"\nmodel = "m"\n'
            f'preset = "generic-text"\nconcurrency = {PLACES}\nqueue = 200\ntimeout_s = {TIMEOUT_S}\n\n{keys}'
            "[teams.all]\nusd_per_month = 1000.0\ntokens_per_month = 100000000\n"
        )
        self.port = free_port()
        environment = os.environ | {
            "GATEWAY_CONFIG": str(folder / "gateway.toml"),
            "CACHE_PATH": str(folder / "answers.sqlite"),
            "GATEWAY_TOKEN": OPERATOR,
            "PORT": str(self.port),
            "HEAD_TIMEOUT_S": "1",
            "BODY_TIMEOUT_S": "1",
            "KEEP_ALIVE_S": "2",
        }
        self.log = (folder / "log").open("wb")
        command = [sys.executable, "-m", "services.vlm_gateway"]
        self.process = subprocess.Popen(command, env=environment, cwd=ROOT, stdout=self.log, stderr=self.log)
        self._client = httpx.Client(
            base_url=f"http://127.0.0.1:{self.port}", headers={"authorization": f"Bearer {OPERATOR}"}, timeout=20
        )

    def get(self, path: str) -> httpx.Response:
        answer = self._client.get(path, headers={"connection": "close"})
        answer.raise_for_status()
        return answer

    def wait(self) -> None:
        for _ in range(200):
            try:
                self.get("/readyz")
                return
            except httpx.HTTPError:
                time.sleep(0.1)
        raise SystemExit("the gateway did not start")

    def files(self) -> int:
        return len(os.listdir(f"/proc/{self.process.pid}/fd"))

    def memory(self) -> float:
        return resident_mb({self.process.pid})


def figure(page: str, name: str, **labels: str) -> float:
    """The sum of a figure's series with these labels."""
    lines = (line for line in page.splitlines() if line.startswith((name + "{", name + " ")))
    return sum(float(line.rsplit(" ", 1)[1]) for line in lines if all(f'{k}="{v}"' in line for k, v in labels.items()))


async def run(minutes: float, rate: float, seed: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        model = await soak_model.serve()
        gateway = Gateway(Path(folder), model.sockets[0].getsockname()[1])
        try:
            await asyncio.to_thread(gateway.wait)
            return await _soaked(gateway, minutes, rate, seed)
        finally:
            gateway.process.send_signal(signal.SIGTERM)
            await asyncio.to_thread(gateway.process.wait, 40)
            model.close()


async def _soaked(gateway: Gateway, minutes: float, rate: float, seed: int) -> dict[str, Any]:
    soak, samples = Soak(gateway.port, seed), list[Sample]()
    running: set[asyncio.Task[None]] = set()
    files_before = gateway.files()
    began = time.monotonic()
    shown = began
    pace = random.Random(seed + 1)
    while (now := time.monotonic()) < began + minutes * 60:
        task = asyncio.create_task(soak.one())
        running.add(task)
        task.add_done_callback(running.discard)
        if now > shown + 10:
            shown = now
            samples.append(Sample(soak.asked, gateway.memory()))
            sys.stderr.write(
                f"\r{(now - began) / 60:.1f} min, {soak.asked} requests, {samples[-1].resident_mb:.1f} MB "
            )
        await asyncio.sleep(pace.expovariate(rate))
    await asyncio.gather(*running)
    await asyncio.sleep(6.0)  # deadlines, kept connections and the last charges
    gc.collect()
    return await asyncio.to_thread(_left, gateway, soak, samples, files_before)


def _left(gateway: Gateway, soak: Soak, samples: list[Sample], files_before: int) -> dict[str, Any]:
    """What is held, and what is wrong with that."""
    owners = {(o["kind"], o["name"]): o for o in gateway.get("/v1/usage").json()["owners"]}
    page, model = gateway.get("/metrics").text, gateway.get("/v1/status").json()["models"]["mock"]
    charged = {
        name: [sum(m[kind] for m in owners["key", name]["month"]) for kind in ("prompt_tokens", "completion_tokens")]
        for name in KEYS
    }
    counted = {
        name: [figure(page, "vlm_gateway_tokens_total", key=name, kind=kind) for kind in ("prompt", "completion")]
        for name in KEYS
    }
    team = [sum(m[kind] for m in owners["team", "all"]["month"]) for kind in ("prompt_tokens", "completion_tokens")]
    reserved = sum(budget["reserved"] for owner in owners.values() for budget in owner["budgets"])
    files = gateway.files()
    slope = _slope(samples[len(samples) // 3 :])
    checks = {
        "no place at the model is held": (model["running"], model["waiting"]) == (0, 0),
        "no server counts a call": [server["running"] for server in model["servers"]] == [0],
        "no request is in flight": figure(page, "http_requests_in_flight") <= 1,
        "no more files are open than before": files <= files_before + 2,
        "nothing is reserved": reserved == 0,
        "steady was charged to the token": charged["steady"] == soak.wanted,
        "store and figures agree": charged == counted,
        "the team was charged what its keys were": team == [sum(two) for two in zip(*charged.values(), strict=True)],
        "memory does not grow with requests": slope < MB_A_THOUSAND,
        "every place can be taken": asyncio.run(_places_free(soak)),
        "nothing odd was seen": not soak.odd,
    }
    return {
        "requests": soak.asked,
        "deeds": dict(soak.deeds),
        "statuses": dict(sorted(soak.statuses.items())),
        "charged": charged,
        "wanted": soak.wanted,
        "files": [files_before, files],
        "mb": [samples[0].resident_mb, samples[-1].resident_mb] if samples else [],
        "mb_a_thousand": round(slope, 3),
        "odd": soak.odd[:10],
        "checks": checks,
    }


async def _places_free(soak: Soak) -> bool:
    """Whether as many calls as the key may have are answered at once."""
    calls = [soak._exchange(soak.request("leaver", "whole", 5, f"last {at}")) for at in range(KEY_PLACES)]
    return {answered.status for answered in await asyncio.gather(*calls)} == {200}


def _slope(samples: list[Sample]) -> float:
    """MB a thousand requests."""
    if len(samples) < 3:
        return 0.0
    return statistics.linear_regression([s.requests for s in samples], [s.resident_mb for s in samples]).slope * 1000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=3.0, help="requests a second, at random (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    found = asyncio.run(run(arguments.minutes, arguments.rate, arguments.seed))
    sys.stdout.write(json.dumps(found, indent=1) + "\n")
    sys.exit(0 if all(found["checks"].values()) else 1)


if __name__ == "__main__":
    main()

"""`python -m tests.load.bench_gateway_redis`: what a Redis that is stopped costs the gateway's callers, and how many.

Rounds: chats one after another with Redis well, then Redis is stopped (SIGSTOP, so that connections stay open and
nothing answers) and as many again, then it goes on. Every chat is another one, so that each looks in the cache. What is
wanted: all are answered, one waits at most 60 ms longer, the others don't wait at all.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from http.client import HTTPConnection
from itertools import count
from pathlib import Path
from typing import NamedTuple

from tests.conftest import RedisProcess
from tests.load.gateway_peers import mock_server, process
from tests.load.processes import free_port

CHATS = 20


class Round(NamedTuple):
    """Milliseconds: a chat as a rule with Redis well and the slowest of them; then with Redis stopped the slowest, how
    much longer than the rule that took, and the second slowest."""

    well_p50: float
    well_slowest: float
    stopped_slowest: float
    waited: float
    stopped_second: float
    failed: int


class Caller:
    """Chats at one gateway over one kept connection, no two alike."""

    def __init__(self, port: int) -> None:
        self._connection = HTTPConnection("127.0.0.1", port, timeout=30)
        self._numbers = count()
        self.failed = 0

    def chat(self) -> float:
        """Milliseconds to the whole answer."""
        message = {"role": "user", "content": f"question {next(self._numbers)}"}
        body = json.dumps({"model": "m", "messages": [message], "temperature": 0})
        began = time.perf_counter()
        self._connection.request("POST", "/v1/chat/completions", body, {"Content-Type": "application/json"})
        answer = self._connection.getresponse()
        answer.read()
        self.failed += answer.status != 200
        return (time.perf_counter() - began) * 1000

    def cache_is_well(self) -> bool:
        self._connection.request("GET", "/v1/status")
        return bool(json.loads(self._connection.getresponse().read())["cache"]["state"] == "ok")


def tried(caller: Caller, redis: subprocess.Popen[bytes]) -> Round:
    failed = caller.failed
    well = [caller.chat() for _ in range(CHATS)]
    time.sleep(0.1)  # what is to be written is
    redis.send_signal(signal.SIGSTOP)
    try:
        stopped = sorted(caller.chat() for _ in range(CHATS))
    finally:
        redis.send_signal(signal.SIGCONT)
    while not caller.cache_is_well():
        time.sleep(0.05)
    rule = statistics.median(well)
    return Round(rule, max(well), stopped[-1], stopped[-1] - rule, stopped[-2], caller.failed - failed)


def run(rounds: int) -> list[Round]:
    cores = sorted(os.sched_getaffinity(0))
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        os.sched_setaffinity(0, {cores[-1]})
        mock = stack.enter_context(mock_server(cores[-1]))
        redis = RedisProcess(folder)
        stack.callback(redis.stop)
        config = folder / "gateway.toml"
        config.write_text(f'[models.m]\nbackend = "chat"\nbase_url = "{mock}/v1"\nmodel = "m"\npreset = "gpt-4o"\n')
        port = free_port()
        environment = {
            "GATEWAY_CONFIG": str(config),
            "REDIS_URL": redis.url,
            "PORT": str(port),
            "HOST": "127.0.0.1",
        }
        url = f"http://127.0.0.1:{port}"
        command = [sys.executable, "-m", "services.vlm_gateway"]
        stack.enter_context(process("ours", command, url, "/readyz", environment, cores[0]))
        caller = Caller(port)
        for _ in range(CHATS):
            caller.chat()
        return [tried(caller, redis.process) for _ in range(rounds)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=10)
    rounds = run(parser.parse_args().rounds)
    sys.stdout.write("Redis well: p50, slowest | stopped: slowest, longer than p50 by, second slowest | failed\n")
    for one in rounds:
        sys.stdout.write(
            f"{one.well_p50:15.1f} {one.well_slowest:8.1f} | {one.stopped_slowest:16.1f} {one.waited:19.1f} "
            f"{one.stopped_second:15.1f} | {one.failed}\n"
        )
    waited = statistics.median(one.waited for one in rounds)
    sys.stdout.write(f"median of {len(rounds)}: one chat waits {waited:.1f} ms longer (ms throughout)\n")


if __name__ == "__main__":
    main()

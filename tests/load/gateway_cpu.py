"""`python -m tests.load.gateway_cpu --against FOLDER`: processor time a request, this tree's gateway against another's.

FOLDER is a working tree in which `make setup` was run, such as one made by `git worktree add FOLDER v0.1.0`. Both
gateways run on one core with everything on, before one mock and one Redis on the other; they take turns (A B, B A,
...) within one run, and while one is asked the other stands still. What is counted is what the gateway's process uses,
user and system, as the scheduler counts it. Five workloads: A to D of `bench_gateway`, and S, a stream of 36 events.

Shown are the medians, their ratio, and the middle half of the ratios of neighbouring runs: the noise. Others on the
machine only ever make a run dearer, so the ratio of the least times says most where it is busy.
"""

import argparse
import os
import random
import statistics
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from tests.load.bench_gateway import alone, body
from tests.load.bench_vlm_gateway import redis_server
from tests.load.closed_loop import drive
from tests.load.gateway_peers import KEY, ROOT, Peer, mock_server, ours, tree

CONNECTIONS = 8
WORKLOADS = {"A": "a small text", "B": "a picture", "C": "five pictures", "D": "cached", "S": "a stream"}


class Pair(NamedTuple):
    """Microseconds a request, of the other gateway and of this one, in two runs one after the other."""

    other_us: float
    this_us: float


def scheduled_s(pids: set[int]) -> float:
    """Processor time of all threads of these processes, to the microsecond."""
    files = [path for pid in pids for path in Path(f"/proc/{pid}/task").glob("*/schedstat")]
    return sum(int(path.read_text().split()[0]) for path in files) / 1e9


def measured_us(peer: Peer, workload: str, seconds: float) -> float:
    pids = tree(peer.roots)
    one = body(workload)
    drive(peer.url, KEY, one, CONNECTIONS, 0.1, f"{random.getrandbits(48):x}-")
    before = scheduled_s(pids)
    took = drive(peer.url, KEY, one, CONNECTIONS, seconds, f"{random.getrandbits(48):x}-")
    used = scheduled_s(pids) - before
    if took.failed:
        raise SystemExit(f"{peer.name}: {took.failed} of {len(took.latencies_s)} requests failed")
    return used * 1e6 / len(took.latencies_s)


def run(against: Path, workloads: str, seconds: float, repeats: int) -> dict[str, list[Pair]]:
    cores = sorted(os.sched_getaffinity(0))
    front, back = cores[0], cores[-1]
    pairs: dict[str, list[Pair]] = {workload: [] for workload in workloads}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        os.sched_setaffinity(0, {back})
        mock = stack.enter_context(mock_server(back))
        redis = stack.enter_context(redis_server(str(folder)))
        peers = [
            ours(stack, folder, mock, redis.removesuffix("0") + str(number), front, root=root, name=name)
            for number, (name, root) in enumerate((("other", against), ("this", ROOT)))
        ]
        for repeat in range(repeats + 1):
            for workload in workloads:
                took = {}
                for peer in peers if repeat % 2 else reversed(peers):
                    with alone(peer, peers):
                        took[peer.name] = measured_us(peer, workload, seconds)
                if repeat:  # the first round warms up
                    pairs[workload].append(Pair(took["other"], took["this"]))
            sys.stderr.write(f"\r{repeat}/{repeats}")
    sys.stderr.write("\r" + " " * 20 + "\r")
    return pairs


def ratio(pairs: Sequence[Pair]) -> float:
    """Of the medians."""
    return statistics.median(p.this_us for p in pairs) / statistics.median(p.other_us for p in pairs)


def show(pairs: dict[str, list[Pair]]) -> None:
    table = Table(title="processor time a request; medians", title_justify="left")
    for column in ("", "", "other", "this", "ratio", "middle half", "of the least"):
        table.add_column(column, justify="left" if not column else "right")
    for workload, runs in pairs.items():
        ratios = [pair.this_us / pair.other_us for pair in runs]
        low, _, high = statistics.quantiles(ratios, n=4) if len(ratios) > 1 else [ratios[0]] * 3
        other, this = (statistics.median(times) for times in zip(*runs, strict=True))
        table.add_row(
            workload,
            WORKLOADS[workload],
            f"{other:.0f} us",
            f"{this:.0f} us",
            f"{ratio(runs):.3f}",
            f"{low:.3f} to {high:.3f}",
            f"{min(p.this_us for p in runs) / min(p.other_us for p in runs):.3f}",
        )
    Console(width=100).print(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, required=True, metavar="FOLDER", help="the other working tree")
    parser.add_argument("--seconds", type=float, default=1.0, help="a run (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=9, help="pairs of runs a workload (default: %(default)s)")
    parser.add_argument("--workloads", default="ABCDS")
    parser.add_argument("--at-most", type=float, help="the code is 1 where a ratio is over this")
    arguments = parser.parse_args()
    if unknown := set(arguments.workloads) - set(WORKLOADS):
        parser.error(f"--workloads: {''.join(sorted(unknown))}; there are {''.join(WORKLOADS)}")
    if not (arguments.against / ".venv" / "bin" / "python").exists():
        parser.error(f"--against: {arguments.against} has no .venv; run `make setup` there")
    pairs = run(arguments.against.resolve(), arguments.workloads, arguments.seconds, arguments.repeats)
    show(pairs)
    if arguments.at_most is not None and max(map(ratio, pairs.values())) > arguments.at_most:
        sys.exit(1)


if __name__ == "__main__":
    main()

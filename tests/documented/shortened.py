"""`python -m tests.documented.shortened PROGRAM WORDS...`: a documented command as a page of commands runs it.

The words are the document's. What takes minutes is cut short by options put behind them (the last one given counts),
what stays until Ctrl-C is sent one as soon as it tells its address, and requests go to the services of the tests. The
file `ran.jsonl` of the page's folder has what was run.
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.conftest import free_port

PAGE = Path(os.environ.get("DOCUMENTED_PAGE", "."))
SMALL = ("--image-size", "320")
CUTS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (r"logisticsvln bench .*--subtask parse", ()),
    (r"logisticsvln bench .*--offline", ("--limit", "6")),
    (r"logisticsvln bench .*--subtask", ("--limit", "2", *SMALL)),
    (r"logisticsvln bench merge", ()),
    (r"logisticsvln bench .*--shard \d/3", ("--limit", "3", "--workers", "1", *SMALL)),
    (r"logisticsvln bench .*--shard", ("--limit", "8", "--workers", "1", *SMALL)),
    (r"logisticsvln bench .*--count", ("--count", "1", "--workers", "1", *SMALL)),
    (r"logisticsvln bench", ("--limit", "1", "--workers", "1", *SMALL)),
    (r"logisticsvln tasks generate", ("--count", "1")),
    (r"logisticsvln evaluate", ("--tasks", "2", "--strange", "2")),
    (r"logisticsvln deliver", SMALL),
    (r"logisticsvln scene new", ("--kind", "low_rise", "--floors", "4", "--object", "flower_pot", "--colour", "red")),
    (r"python -m tests.load.bench_engine", ("--deliveries", "1")),
    (r"python -m tests.load.bench_explorer", ("--worlds", "1")),
    (r"python -m tests.load.bench_model", ("--rounds", "1")),
    (r"python -m tests.load.bench_orchestrator", ("--posts", "20")),
    (r"python -m tests.load.explorer_\w+ .*--tasks", ("--every", "300")),
    (r"python -m tests.load.soak", ("--minutes", "0.5", "--bound", "100000")),
)
STAYS = re.compile(r"logisticsvln (serve|replay)\b|logisticsvln bench .*--backend human")
STARTS_WITHIN_S = 300.0
INTERRUPTED = 130
"""What our commands end with after Ctrl-C where there was more to do."""


def shortened(line: str) -> tuple[str, ...]:
    """What is put behind that command."""
    if re.match(r"logisticsvln vehicles", line):
        return ("--at", f"http://127.0.0.1:{listening().get('8100', 8100)}")
    cut = next((more for pattern, more in CUTS if re.match(pattern, line)), ())
    if re.match(r"logisticsvln scene new", line):
        return (*cut, "--floor", "3", "--seed", "1")
    return (*cut, "--base-port", str(free_port() // 2)) if re.match(r"logisticsvln serve", line) else cut


def listening() -> dict[str, int]:
    """At which ports the services of the tests listen, by the documents' ports."""
    ports: dict[str, int] = json.loads(os.environ.get("DOCUMENTED_PORTS", "{}"))
    return ports


def to_the_tests(words: list[str]) -> list[str]:
    """A `curl` whose services listen at the tests' ports, and whose ID is that of the delivery ordered last."""
    ports = listening()
    known = PAGE / "id"
    number = known.read_text() if known.exists() else "ID"
    moved = [re.sub(r"(localhost|127\.0\.0\.1):(\d+)/", lambda m: f"{m[1]}:{ports[m[2]]}/", word) for word in words]
    return [word.replace("/ID/", f"/{number}/") for word in moved]


def until_it_listens(command: list[str]) -> int:
    """Runs what stays; sends it Ctrl-C when it has told an address."""
    said = PAGE / "said"
    with said.open("wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out)
    give_up = time.monotonic() + STARTS_WITHIN_S
    while process.poll() is None and not re.search(rb"http://127\.0\.0\.1:\d+", said.read_bytes()):
        if time.monotonic() > give_up:
            process.kill()
            raise SystemExit(f"it tells no address: {said.read_text()}")
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    code = process.wait(60)
    sys.stderr.write(text := said.read_text())
    assert "Traceback" not in text, text
    return 0 if code == INTERRUPTED else code


def main(program: str, words: list[str]) -> int:
    line = f"{program} {' '.join(words)}"
    began = time.monotonic()
    if program == "curl":
        done = subprocess.run([os.environ["DOCUMENTED_CURL"], *to_the_tests(words)], stdout=subprocess.PIPE)
        code = done.returncode
        if (answer := re.match(rb'\{"id":"([\w-]+)"', done.stdout)) is not None:
            (PAGE / "id").write_bytes(answer[1])
        sys.stdout.buffer.write(done.stdout)
    else:
        entry = ["-m", "command_line"] if program == "logisticsvln" else []
        command = [sys.executable, *entry, *words, *shortened(line)]
        code = until_it_listens(command) if STAYS.match(line) else subprocess.run(command).returncode
    ran = {"command": line, "code": code, "seconds": round(time.monotonic() - began, 1)}
    with (PAGE / "ran.jsonl").open("a", encoding="utf-8") as log:
        log.write(json.dumps(ran) + "\n")
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))

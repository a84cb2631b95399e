"""A PostgreSQL of the tests' own: Debian's, in a folder and at a port that nobody else knows."""

import contextlib
import os
import pwd
import shutil
import subprocess
import tempfile
import time
import uuid
from pathlib import Path

import psycopg

from tests.ending import WITH_THE_TESTS

PROGRAMS = Path("/usr/lib/postgresql")


class Postgres:
    """A server, which may be stopped and started again; each test makes a database of its own."""

    def __init__(self, port: int) -> None:
        found = sorted(PROGRAMS.glob("*/bin/postgres"))
        if not found:
            raise RuntimeError("PostgreSQL is not installed; `make test` installs Debian's package postgresql")
        self._programs = found[-1].parent
        self._folder = Path(tempfile.mkdtemp(prefix="postgres-"))
        # it refuses to run as root
        self._user = "postgres" if os.getuid() == 0 else None
        if self._user is not None:
            os.chown(self._folder, pwd.getpwnam(self._user).pw_uid, -1)
        self.port = port
        self._run("initdb", "--auth=trust", "--username=tests", "--encoding=UTF8", "--locale=C", "--no-sync")
        self._process = self._spawn()

    def database(self) -> str:
        """The URL of a new, empty database."""
        name = f"deliveries_{uuid.uuid4().hex[:12]}"
        with psycopg.connect(self._url("postgres"), autocommit=True) as connection:
            connection.execute(f'CREATE DATABASE "{name}"'.encode())
        return self._url(name)

    def restart(self) -> None:
        """Breaks off every connection, as a failing database does."""
        self.stop()
        self._process = self._spawn()

    def stop(self) -> None:
        self._process.terminate()  # SIGTERM waits for clients
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(0.5)
        if self._process.poll() is None:
            self._process.send_signal(2)
            self._process.wait(20)

    def close(self) -> None:
        self.stop()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _url(self, database: str) -> str:
        return f"postgresql://tests@127.0.0.1:{self.port}/{database}"

    def _run(self, program: str, *options: str) -> None:
        command = [self._programs / program, "--pgdata", self._folder / "data", *options]
        done = subprocess.run(command, user=self._user, capture_output=True, cwd="/", check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{program}: {done.stderr.decode()}")

    def _spawn(self) -> subprocess.Popen[bytes]:
        options = {
            "port": self.port,
            "listen_addresses": "127.0.0.1",
            "unix_socket_directories": "",
            "fsync": "off",
            "max_connections": 200,
        }
        command: list[object] = [*WITH_THE_TESTS, self._programs / "postgres", "-D", self._folder / "data"]
        for name, value in options.items():
            command += ["-c", f"{name}={value}"]
        with (self._folder / "log").open("ab") as log:
            process = subprocess.Popen(list(map(str, command)), user=self._user, cwd="/", stdout=log, stderr=log)
        give_up = time.monotonic() + 30
        while time.monotonic() < give_up:
            with contextlib.suppress(psycopg.OperationalError), psycopg.connect(self._url("postgres")):
                return process
            time.sleep(0.05)
        process.kill()
        process.wait()
        raise RuntimeError(f"PostgreSQL did not start: {(self._folder / 'log').read_text()}")

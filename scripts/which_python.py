"""`python scripts/which_python.py`: whether this Python can run the project. Any Python 3 can read it."""

import sqlite3
import sys

LOWEST, HIGHEST = (3, 11), (3, 12)
SUBSECONDS = (3, 42)
"""The SQLite with `unixepoch('subsec')`, which DBOS takes for granted from Python 3.12 on: without it no orchestrator
starts."""


def problem_of(python: "tuple[int, ...]", sqlite: "tuple[int, ...]") -> "str | None":
    """What is wrong with a Python of that version before that SQLite, None where nothing is."""
    named = ".".join(str(part) for part in python[:2])
    if not LOWEST <= tuple(python[:2]) <= HIGHEST:
        return "Python 3.11 or 3.12 is needed; {} is " + named
    if tuple(python[:2]) > LOWEST and tuple(sqlite) < SUBSECONDS:
        has = ".".join(str(part) for part in sqlite)
        return (
            "Python " + named + " wants SQLite 3.42 or newer; {} has " + has + ": take Python 3.11 (PYTHON=python3.11)"
        )
    return None


if __name__ == "__main__":
    found = problem_of(tuple(sys.version_info[:3]), sqlite3.sqlite_version_info)
    sys.exit(found and found.format(sys.executable))

"""`python -m service_kit.healthcheck URL`: exit status 0 when the URL answers 200, for containers without curl."""

import sys
from urllib.error import URLError
from urllib.request import urlopen


def healthy(url: str, timeout_s: float = 3.0) -> bool:
    """True when `url` answers 200 in time."""
    try:
        with urlopen(url, timeout=timeout_s) as response:
            return bool(response.status == 200)
    except (URLError, OSError, ValueError):
        return False


if __name__ == "__main__":
    raise SystemExit(0 if len(sys.argv) == 2 and healthy(sys.argv[1]) else 1)

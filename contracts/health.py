"""What every service says of itself at `/healthz` and `/readyz`."""

from typing import Literal

from contracts.base import Wire

Access = Literal["open", "granted", "missing_token", "wrong_token"]
"""What the request's own token is worth to the service: it needs none, it accepts this one, it misses one, it refuses
this one. Asking for health needs no token, so this is how a caller learns beforehand that its token is not right."""


class Health(Wire):
    """`checks` by name, "ok" or what is wrong; `about`: which parts were chosen."""

    status: Literal["ok", "ready"]
    service: str
    access: Access = "open"
    checks: dict[str, str] = {}
    about: dict[str, str] = {}

"""By which names a server may be called, and whether it may be called from elsewhere without a token.

A web page of somebody else's can point its own name at 127.0.0.1 and then read what a server there answers, as its own
page (DNS rebinding); the name still stands in `Host`. An address written as numbers can't be bent that way, and neither
can a name without a dot, such as a container's: nobody can register one.
"""

import ipaddress
import re
from collections.abc import Collection, Iterable

LOOPBACK_NAMES = ("localhost", "ip6-localhost")


class Hosts:
    """`allowed`: names, `*.example.org` for all below one, `*` for any; the loopback's names and plain IP addresses are
    always among them, and so are names without a dot."""

    def __init__(self, allowed: Iterable[str] = ()) -> None:
        names = {name.strip().lower() for name in allowed} - {""}
        self._names = names | set(LOOPBACK_NAMES)
        self._below = tuple(name[1:] for name in names if name.startswith("*."))
        self._any = "*" in names
        self._right: bytes | None = None  # what was right last: most requests say the same

    def allow(self, host: str) -> bool:
        """`host` is the header's value: a name or an address, perhaps with a port."""
        name = _without_port(host.strip().lower()).removesuffix(".")
        return self._any or name in self._names or name.endswith(self._below) or is_address(name) or is_local_name(name)

    def are_named_in(self, headers: Collection[tuple[bytes, bytes]]) -> bool:
        """Whether every `Host` of a request is an allowed one."""
        once = dict(headers)
        if len(once) == len(headers) and (host := once.get(b"host")) is not None and host == self._right:
            return True
        said = [value for name, value in headers if name == b"host"]
        if not all(self.allow(value.decode("latin-1")) for value in said):
            return False
        self._right = said[0] if said else None
        return True


def is_local_name(name: str) -> bool:
    """Whether it is one label, which only this network's own names are."""
    return re.fullmatch(r"[a-z0-9_]([a-z0-9_-]*[a-z0-9_])?", name) is not None


def is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches what listens there."""
    return host.lower() in LOOPBACK_NAMES or (is_address(host) and ipaddress.ip_address(host).is_loopback)


def _without_port(host: str) -> str:
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.rpartition(":")[0] if host.count(":") == 1 else host

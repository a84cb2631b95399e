"""Settings out of an environment that is handed in; secrets may lie in files."""

from collections.abc import Mapping
from pathlib import Path
from urllib.parse import urlsplit, urlunsplit


class BadSetting(Exception):
    """A setting that can't be used; the message names it and says what would have been right."""


class Settings:
    """Typed look-ups in `environment` (normally `os.environ`, handed in by the process's entry point)."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._environment = environment

    def text(self, name: str, default: str | None = None) -> str | None:
        """The value, or that of the file named by `<name>_FILE`, or the default; empty counts as not set."""
        value = self._environment.get(name)
        if value:
            return value
        path = self._environment.get(f"{name}_FILE")
        if path:
            try:
                return Path(path).read_text(encoding="utf-8").strip() or default
            except OSError as error:
                raise BadSetting(f"{name}_FILE={path}: {error.strerror}; name a readable file") from None
        return default

    def required(self, name: str) -> str:
        value = self.text(name)
        if value is None:
            raise BadSetting(f"{name} is not set; set it or {name}_FILE")
        return value

    def integer(self, name: str, default: int, low: int, high: int) -> int:
        return int(self._number(name, default, low, high, int))

    def number(self, name: str, default: float, low: float, high: float) -> float:
        return self._number(name, default, low, high, float)

    def flag(self, name: str, default: bool = False) -> bool:
        value = (self.text(name) or "").lower()
        if value in ("", "1", "true", "yes", "on", "0", "false", "no", "off"):
            return default if not value else value in ("1", "true", "yes", "on")
        raise BadSetting(f"{name}={value}: say on or off")

    def choice(self, name: str, default: str, allowed: tuple[str, ...]) -> str:
        value = self.text(name, default) or default
        if value not in allowed:
            raise BadSetting(f"{name}={value}: choose one of {', '.join(allowed)}")
        return value

    def _number(self, name: str, default: float, low: float, high: float, kind: type[int] | type[float]) -> float:
        value = self.text(name)
        if value is None:
            return default
        try:
            number = kind(value)
        except ValueError:
            number = float("nan")
        if not low <= number <= high:
            raise BadSetting(f"{name}={value}: give a number from {low:g} to {high:g}")
        return number


def without_password(url: str) -> str:
    """The URL as it may be shown: user and password left out."""
    parts = urlsplit(url)
    host = parts.hostname or ""
    port = f":{parts.port}" if parts.port else ""
    return urlunsplit((parts.scheme, host + port, parts.path, "", ""))

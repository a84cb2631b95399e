"""The settings of a run over a task set."""

from typing import Any

from contracts.base import Name, Wire
from contracts.orchestrator import MissionSettings


class RunSettings(Wire):
    """Everything needed to fly a run again."""

    tasks: str
    checksum: str
    count: int
    backend: Name
    mission: MissionSettings
    oracle: dict[str, float] = {}
    workers: int
    versions: dict[str, str]
    renderer: str | None = None
    model: dict[str, Any] = {}

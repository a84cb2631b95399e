"""The settings of a run over a task set."""

from typing import Any, Self

from pydantic import JsonValue, TypeAdapter

from contracts.base import ModelName, Wire
from contracts.orchestrator import MissionSettings
from evaluation.bench.customer import Asked
from evaluation.bench.sensor_faults import SensorFaults
from evaluation.bench.shard import Shard
from mission.policies import DEFAULT, policy_type

_DOCUMENT = TypeAdapter(dict[str, JsonValue])
_OF_POLICIES = ("choice", "min_move_m", "safe_distances")
"""What version 0.1 had among the mission's settings, and policies have now."""


class RunSettings(Wire):
    """Everything needed to fly a run again. `count`: how many tasks the whole run has; where it is one `shard` of it,
    only that share of them is flown. `customer`: who answers a mission's questions. `faults`: of the sensors, drawn for
    each task."""

    tasks: str
    checksum: str
    count: int
    backend: ModelName
    mission: MissionSettings
    oracle: dict[str, float] = {}
    workers: int
    versions: dict[str, str]
    renderer: str | None = None
    model: dict[str, Any] = {}
    shard: Shard | None = None
    customer: Asked = "nobody"
    faults: SensorFaults | None = None

    @classmethod
    def read(cls, text: str) -> Self:
        """The settings from JSON; those of version 0.1 say the same in today's words. Raises pydantic.ValidationError,
        BadSearch for a search policy that is not installed here."""
        document = _DOCUMENT.validate_json(text)
        mission = document.get("mission")
        if isinstance(mission, dict) and "choice" in mission:
            document["mission"] = _of_version_0_1(mission)
        return cls.model_validate(document)


def _of_version_0_1(mission: dict[str, JsonValue]) -> dict[str, JsonValue]:
    """The policy's settings stood beside it, and those of all others too."""
    rest = {name: value for name, value in mission.items() if name not in (*_OF_POLICIES, "viewpoint", "explore")}
    rule, explore = _part(mission, "viewpoint"), _part(mission, "explore")
    name = str(rule.get("policy", DEFAULT))
    pool = explore if name == DEFAULT else rule | {n: mission[n] for n in _OF_POLICIES if n in mission}
    own = policy_type(name).settings_type.model_fields
    return rest | {"viewpoint": {"policy": name} | {n: value for n, value in pool.items() if n in own}}


def _part(mission: dict[str, JsonValue], name: str) -> dict[str, JsonValue]:
    part = mission.get(name)
    return part if isinstance(part, dict) else {}

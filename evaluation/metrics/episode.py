"""One flown task as it is written down, and the taxonomy of failures."""

from typing import Annotated, Literal

from pydantic import Field

from contracts.base import Name, Wire
from contracts.orchestrator import DeliveryResult

Reason = Literal[
    "success",
    "parse",
    "floor",
    "missed_object",
    "wrong_object",
    "lost_building",
    "blocked",
    "collision",
    "timeout",
    "unreadable",
    "unreachable",
    "error",
]
"""Why an episode ended as it did: the failure taxonomy, and `success`."""


class EpisodeRecord(Wire):
    """One task as flown by one arm. `error` is set, and `result` null, where the episode itself broke: it counts as a
    failure and stays in every denominator, unless a model or a service was out of reach: that tells nothing of the
    arm. `folder` holds its pictures, where the run keeps them. `questions`: how often the task's customer was asked."""

    task: Name
    reason: Reason
    result: DeliveryResult | None
    error: str | None = None
    started: str
    wall_s: Annotated[float, Field(ge=0)]
    render_s: Annotated[float, Field(ge=0)] = 0.0
    model_s: Annotated[float, Field(ge=0)] = 0.0
    folder: str | None = None
    questions: Annotated[int, Field(ge=0)] = 0

    @property
    def judged(self) -> bool:
        """Whether it says anything of the arm: not where the infrastructure failed."""
        return self.reason != "unreachable"

    @property
    def success(self) -> bool:
        return self.reason == "success"

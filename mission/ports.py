"""What a mission needs from the outside: four small ports that speak the contracts' types.

PortError               a port brought no answer of its contract
  ModelUnreachable      the model behind it can't be reached, or not in time: no answer, so nothing to score
    UnknownModel        the gateway has no model of that name; the message names those there are
    ModelRejected       its server refuses what it is asked, or us; or it was never asked this, in a replay
  ServiceUnreachable    the service itself can't be reached, is full or broken
    ServiceUnusable     it refuses our token, or is not our service, or not of this version
  ServiceRefused        the service answered with an error of its own

Only what is `passing` may be over in a moment, so that asking again may help (`mission.outages`).
"""

from dataclasses import dataclass
from typing import ClassVar, Protocol

from contracts.depth_assist import (
    ApproachAnswer,
    ApproachQuestion,
    ExploreAnswer,
    ExploreQuestion,
    SafeDistancesAnswer,
    SafeDistancesQuestion,
    ViewpointAnswer,
    ViewpointQuestion,
)
from contracts.llm_parser import ParseAnswer, ParseQuestion
from contracts.vlm_gateway import (
    BuildingBoxAnswer,
    BuildingBoxQuestion,
    ChooseDirectionAnswer,
    ChooseDirectionQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    FloorCountAnswer,
    FloorCountQuestion,
    PreflightAnswer,
    PreflightQuestion,
)


class PortError(Exception):
    """A port brought no answer of its contract; the message says which and why."""

    passing: ClassVar[bool] = False


class ModelUnreachable(PortError):
    """The model behind a service can't be reached, or not in time."""

    passing = True


class UnknownModel(ModelUnreachable):
    """There is no model of that name; the message names those there are."""

    passing = False


class ModelRejected(ModelUnreachable):
    """The model's server refuses what it is asked, or whoever asks; or nothing was recorded of this question."""

    passing = False


class ServiceUnreachable(PortError):
    """Nobody answered in time, or only to say that it can't serve."""

    passing = True


class ServiceUnusable(ServiceUnreachable):
    """It answers, and refuses our token, or says what our service would not say."""

    passing = False


class ServiceRefused(PortError):
    """The service's own error; `code` is for programs."""

    def __init__(self, message: str, *, code: str, status: int) -> None:
        super().__init__(message)
        self.code = code
        self.status = status


class Parser(Protocol):
    """Request in, floor and object out. Every method of every port raises PortError and nothing else."""

    async def parse(self, question: ParseQuestion) -> ParseAnswer: ...


class Vision(Protocol):
    """The four typed questions about pictures, and the one before take-off whether they can be asked."""

    async def preflight(self, question: PreflightQuestion) -> PreflightAnswer:
        """Raises UnknownModel; ServiceRefused where the model takes no pictures."""
        ...

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer: ...

    async def building_box(self, question: BuildingBoxQuestion) -> BuildingBoxAnswer: ...

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer: ...

    async def choose_direction(self, question: ChooseDirectionQuestion) -> ChooseDirectionAnswer: ...


class DepthAssist(Protocol):
    """What depth says: which view, how far, which way in."""

    async def viewpoint(self, question: ViewpointQuestion) -> ViewpointAnswer: ...

    async def safe_distances(self, question: SafeDistancesQuestion) -> SafeDistancesAnswer: ...

    async def approach(self, question: ApproachQuestion) -> ApproachAnswer: ...

    async def explore(self, question: ExploreQuestion) -> ExploreAnswer: ...


@dataclass(frozen=True)
class Ports:
    """The services a mission asks; where its drone comes from is `mission.placement`."""

    parser: Parser
    vision: Vision
    depth: DepthAssist

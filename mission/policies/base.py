"""What a search policy is: one class that says, from a look without the object in it, where the next stop is.

Somebody else's package brings one by an entry point of the group `logisticsvln.search_policies` that names its class;
docs/extending.md shows one whole.
"""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeAlias, TypeVar

from contracts.base import Unit, Wire
from contracts.depth_assist import (
    ExploreAnswer,
    ExploreQuestion,
    SafeDistancesAnswer,
    SafeDistancesQuestion,
    ViewpointAnswer,
    ViewpointQuestion,
)
from contracts.event_data import EventData
from contracts.geometry import Box, Point3
from contracts.vlm_gateway import ChooseDirectionAnswer, ChooseDirectionQuestion
from mission.looks import Look
from mission.model_calls import Reply
from mission.record import Pictures


class SearchMemory(Wire):
    """What a policy carries from stop to stop; a policy adds its own fields. `inspected_share`: of the facade on the
    floor searched, null where the policy does not tell."""

    inspected_share: Unit | None = None


class NextStop(NamedTuple):
    """Fly along `path` (empty: only turn), then turn to `yaw` (radians; null: the direction of travel)."""

    path: tuple[Point3, ...]
    yaw: float | None
    why: str


class NothingLeft(NamedTuple):
    """The search is over: there is nothing that could still be reached and seen."""

    why: str


class Told(NamedTuple):
    """What the policy has to say about its decision, for the record."""

    message: str
    data: EventData
    pictures: Pictures | None = None


class Onward(NamedTuple):
    """The way on, and what the policy will remember."""

    stop: NextStop | NothingLeft
    memory: SearchMemory
    told: Told | None = None


class SearchTools(Protocol):
    """What the mission lends a policy. Every question may raise PortError."""

    @property
    def object(self) -> str: ...

    @property
    def floor(self) -> int: ...

    @property
    def building_box(self) -> Box | None:
        """Where the building was in the front picture at the final height."""
        ...

    @property
    def exploration_step(self) -> int:
        """The number of this look in the search, from 1."""
        ...

    @property
    def seed(self) -> int:
        """Of whatever chance plays a part at this step; the same in every run of the same mission."""
        ...

    @property
    def vision_model(self) -> str | None: ...

    @property
    def fallback_turn_deg(self) -> float:
        """How far to turn left where no way is free."""
        ...

    async def viewpoint(self, question: ViewpointQuestion) -> ViewpointAnswer: ...

    async def safe_distances(self, question: SafeDistancesQuestion) -> SafeDistancesAnswer: ...

    async def explore(self, question: ExploreQuestion) -> ExploreAnswer: ...

    async def choose_direction(self, question: ChooseDirectionQuestion) -> Reply[ChooseDirectionAnswer]:
        """Asks the choice model, which makes this place a stop. Not while planning."""
        ...


class Plan(ABC):
    """The way on from one look, worked out as far as that changes nothing."""

    def on_target(self, place: Point3) -> bool:
        """Is the place on the building searched, as far as the policy knows?"""
        return True

    @abstractmethod
    async def onward(self) -> Onward:
        """The decision; it may ask the choice model. Raises PortError."""


S = TypeVar("S", bound=Wire)
M = TypeVar("M", bound=SearchMemory)


class SearchPolicy(ABC, Generic[S, M]):
    """A way to search the building for the object. `name` is what settings say, `label` what people read;
    `settings_type` holds every free constant, `memory_type` what the policy remembers, empty before the first look.
    `knows_building`: its plans can tell the building searched from others."""

    name: ClassVar[str]
    label: ClassVar[str]
    settings_type: ClassVar[type[Wire]]
    memory_type: ClassVar[type[SearchMemory]] = SearchMemory
    knows_building: ClassVar[bool] = False

    def __init__(self, settings: S) -> None:
        self.settings = settings

    def words(self) -> list[str]:
        """The label, and every setting that is not the usual one, for people who compare runs."""
        usual = self.settings_type()
        own = {name: getattr(self.settings, name) for name in self.settings_type.model_fields}
        changed = [f"{name} {value}" for name, value in own.items() if value != getattr(usual, name)]
        return [self.label, *changed]

    @abstractmethod
    async def plan(self, look: Look, memory: M, tools: SearchTools) -> Plan:
        """Works the way on out while the recognition model still looks, so it must change nothing. Raises PortError."""


AnyPolicy: TypeAlias = SearchPolicy[Any, Any]

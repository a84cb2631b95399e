"""What a search policy may ask by its tools, and the answers: messages of depth_assist and of the choice model."""

from contracts.depth_assist import (
    ExploreAnswer,
    ExploreQuestion,
    ExploreSettings,
    SafeDistancesAnswer,
    SafeDistanceSettings,
    SafeDistancesQuestion,
    ViewDepth,
    ViewpointAnswer,
    ViewpointQuestion,
    ViewpointSettings,
)
from contracts.vlm_gateway import ChooseDirectionAnswer, ChooseDirectionQuestion

__all__ = [
    "ChooseDirectionAnswer",
    "ChooseDirectionQuestion",
    "ExploreAnswer",
    "ExploreQuestion",
    "ExploreSettings",
    "SafeDistanceSettings",
    "SafeDistancesAnswer",
    "SafeDistancesQuestion",
    "ViewDepth",
    "ViewpointAnswer",
    "ViewpointQuestion",
    "ViewpointSettings",
]

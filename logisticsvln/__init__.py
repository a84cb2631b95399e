"""LogisticsVLN for programs: deliveries of a running orchestrator, flights in this process, scenes, and what they tell.

Whatever is named here is the public surface: it changes only with a line in CHANGELOG.md. Each name is loaded when it
is first used, so that a program which only asks an orchestrator needs no more than the extra `client`.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from contracts.cameras import Camera, Rig, load_rig
    from contracts.events import Event
    from contracts.geometry import Box, Point2, Point3, Pose
    from contracts.orchestrator import (
        Delivery,
        DeliveryQuestion,
        DeliveryResult,
        MissionSettings,
        OpenQuestion,
        Sample,
        SearchSettings,
    )
    from contracts.scene import Scene
    from contracts.sim import Flight, Verdict
    from contracts.vlm_gateway import MarkedPoint, Match
    from launcher.processes import CannotStart
    from logisticsvln.async_client import AsyncClient
    from logisticsvln.async_flights import AsyncLocalServices
    from logisticsvln.client import Client
    from logisticsvln.flights import Flown, LocalServices, fly
    from logisticsvln.scenes import BadScene, read_scene, sample, samples
    from logisticsvln.vision import NOTHING, CameraPicture, OwnVision
    from mission.looks import Look, Sight
    from mission.places import ahead
    from mission.policies.base import NextStop, NothingLeft, Onward, Plan, SearchMemory, SearchPolicy, SearchTools
    from mission.ports import ModelUnreachable, PortError
    from orchestrator.delivery import BadDelivery
    from service_kit.client import CallError, Garbled, Refused, TimedOut, Unreachable

_WHERE = {
    "AsyncClient": "logisticsvln.async_client",
    "AsyncLocalServices": "logisticsvln.async_flights",
    "BadDelivery": "orchestrator.delivery",
    "Box": "contracts.geometry",
    "CallError": "service_kit.client",
    "Camera": "contracts.cameras",
    "CameraPicture": "logisticsvln.vision",
    "CannotStart": "launcher.processes",
    "Client": "logisticsvln.client",
    "Delivery": "contracts.orchestrator",
    "DeliveryQuestion": "contracts.orchestrator",
    "DeliveryResult": "contracts.orchestrator",
    "Event": "contracts.events",
    "Flight": "contracts.sim",
    "Flown": "logisticsvln.flights",
    "BadScene": "logisticsvln.scenes",
    "NOTHING": "logisticsvln.vision",
    "Garbled": "service_kit.client",
    "LocalServices": "logisticsvln.flights",
    "Look": "mission.looks",
    "MarkedPoint": "contracts.vlm_gateway",
    "Match": "contracts.vlm_gateway",
    "MissionSettings": "contracts.orchestrator",
    "ModelUnreachable": "mission.ports",
    "NextStop": "mission.policies.base",
    "NothingLeft": "mission.policies.base",
    "Onward": "mission.policies.base",
    "OpenQuestion": "contracts.orchestrator",
    "OwnVision": "logisticsvln.vision",
    "Plan": "mission.policies.base",
    "Point2": "contracts.geometry",
    "Point3": "contracts.geometry",
    "PortError": "mission.ports",
    "Pose": "contracts.geometry",
    "Refused": "service_kit.client",
    "Rig": "contracts.cameras",
    "Sample": "contracts.orchestrator",
    "Scene": "contracts.scene",
    "SearchMemory": "mission.policies.base",
    "SearchPolicy": "mission.policies.base",
    "SearchSettings": "contracts.orchestrator",
    "SearchTools": "mission.policies.base",
    "Sight": "mission.looks",
    "TimedOut": "service_kit.client",
    "Unreachable": "service_kit.client",
    "Verdict": "contracts.sim",
    "ahead": "mission.places",
    "fly": "logisticsvln.flights",
    "load_rig": "contracts.cameras",
    "read_scene": "logisticsvln.scenes",
    "sample": "logisticsvln.scenes",
    "samples": "logisticsvln.scenes",
}

__all__ = [
    "NOTHING",
    "AsyncClient",
    "AsyncLocalServices",
    "BadDelivery",
    "BadScene",
    "Box",
    "CallError",
    "Camera",
    "CameraPicture",
    "CannotStart",
    "Client",
    "Delivery",
    "DeliveryQuestion",
    "DeliveryResult",
    "Event",
    "Flight",
    "Flown",
    "Garbled",
    "LocalServices",
    "Look",
    "MarkedPoint",
    "Match",
    "MissionSettings",
    "ModelUnreachable",
    "NextStop",
    "NothingLeft",
    "Onward",
    "OpenQuestion",
    "OwnVision",
    "Plan",
    "Point2",
    "Point3",
    "PortError",
    "Pose",
    "Refused",
    "Rig",
    "Sample",
    "Scene",
    "SearchMemory",
    "SearchPolicy",
    "SearchSettings",
    "SearchTools",
    "Sight",
    "TimedOut",
    "Unreachable",
    "Verdict",
    "ahead",
    "fly",
    "load_rig",
    "read_scene",
    "sample",
    "samples",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'logisticsvln' has no {name!r}; it has {', '.join(__all__)}")
    try:
        value = getattr(importlib.import_module(_WHERE[name]), name)
    except ModuleNotFoundError as error:
        raise ImportError(
            f"logisticsvln.{name} needs {error.name}, which is not installed: pip install '.[all]' from the repository"
        ) from error
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__

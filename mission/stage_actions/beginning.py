"""From the customer's words to a drone in the air."""

from dataclasses import replace

from contracts.event_data import ParsedData, PlacedData
from contracts.llm_parser import ParseQuestion
from contracts.vlm_gateway import PreflightQuestion
from mission.model_calls import Answered
from mission.places import spoken
from mission.stages import MeasureStandOff, PlaceDrone, Preflight
from mission.step import Drone, MissionEnd, Step

_WANTED = {"floor": "floor", "object": "object at the window"}


async def read_request(step: Step) -> Preflight:
    """Raises MissionEnd: request_incomplete, request_unreadable; PortError."""
    request = step.state.request
    step.enter("parse", "reading the request")
    question = ParseQuestion(request=request, model=step.settings.parser_model)
    reply = await step.ask("parser", step.ports.parser.parse(question))
    answer = reply.answer
    step.update(floor=answer.floor, object=answer.object)
    found = f"floor {answer.floor or '?'}, {answer.object or 'no object'}"
    step.write(
        found if isinstance(reply, Answered) else f"the parser's answer was {answer.outcome}",
        ParsedData(request=request, answer=answer, seconds=round(reply.seconds, 4)),
    )
    if not isinstance(reply, Answered):
        raise MissionEnd("request_unreadable", f"the language model's answer to the request was {answer.outcome}")
    missing = [name for name, value in (("floor", answer.floor), ("object", answer.object)) if value is None]
    if missing:
        wanted = " and no ".join(_WANTED[name] for name in missing)
        raise MissionEnd("request_incomplete", f"the request names no {wanted}; say both, and the search can begin")
    return Preflight()


async def preflight(step: Step) -> PlaceDrone:
    """Raises MissionEnd (object_unknown) for a thing that the model says it has never learnt; PortError."""
    question = PreflightQuestion(model=step.settings.vision_model, object=step.state.object or "")
    answer = await step.timed("preflight", step.ports.vision.preflight(question))
    if answer.known is False:
        raise MissionEnd(
            "object_unknown",
            f"the drone did not take off: it has never learnt to recognise {step.thing} ({answer.why}); "
            "name another thing at the window, or choose a model that knows more",
        )
    return PlaceDrone()


async def place_drone(step: Step) -> MeasureStandOff:
    """The drone of this mission's key, in the air. Raises PortError."""
    step.enter("place", "placing the drone")
    vehicle = await step.timed("place", step.context.placement.begin(step.state.key))
    step.update(vehicle=vehicle.name)
    drone = Drone(vehicle, await vehicle.connect())
    step.context = replace(step.context, drone=drone)
    state = await vehicle.state()
    if state.mode == "landed":
        state = await vehicle.take_off(step.settings.take_off_height_m)
    step.update(drone=state, renderer=await step.context.placement.renderer(vehicle.name))
    step.write(
        f"the drone is at {spoken(state.pose)}: {drone.capabilities.kind}",
        PlacedData(vehicle=vehicle.name, vehicle_kind=drone.capabilities.kind, pose=state.pose, cameras=drone.cameras),
    )
    return MeasureStandOff()

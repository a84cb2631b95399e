"""From the customer's words to a drone in the air."""

from dataclasses import replace

from contracts.event_data import ParsedData, PlacedData, RefusedData
from contracts.geometry import Point3
from contracts.llm_parser import ParseQuestion
from contracts.vehicle import VehicleState
from contracts.vlm_gateway import PreflightQuestion
from mission.frames import FlightRefused
from mission.guard import guarded
from mission.model_calls import Answered
from mission.places import spoken
from mission.questions import about_unknown, left_open, missing_fields, question_of
from mission.stage_actions.asking import ask_customer
from mission.stages import NeedsAnswer, PlaceDrone, Preflight, TakeStand
from mission.step import Drone, MissionEnd, Step
from mission.vehicle import Vehicle


async def read_request(step: Step) -> Preflight | NeedsAnswer:
    """Raises MissionEnd: request_incomplete where nobody can be asked for the rest, request_unreadable; PortError."""
    request, exchanges = step.state.request, step.state.exchanges
    step.enter("parse", "reading the request again, with the answer" if exchanges else "reading the request")
    question = ParseQuestion(
        request=request,
        model=step.settings.parser_model,
        ground_floor=step.settings.ground_floor,
        exchanges=exchanges,
    )
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
    if missing_fields(answer):
        asked = question_of(answer)
        return await ask_customer(step, "request", asked, "request_incomplete", f"{left_open(answer)}: {asked}")
    return Preflight()


async def preflight(step: Step) -> PlaceDrone | NeedsAnswer:
    """Asks for something else at the window where the model says that it has never learnt the thing. Raises MissionEnd
    (object_unknown) where nobody can be asked; PortError."""
    question = PreflightQuestion(model=step.settings.vision_model, object=step.state.object or "")
    answer = await step.timed("preflight", step.ports.vision.preflight(question))
    if answer.known is False:
        why = (
            f"the drone did not take off: it has never learnt to recognise {step.thing} ({answer.why}); "
            "name another thing at the window, or choose a model that knows more"
        )
        asked = about_unknown(step.state.object or "object")
        if any(exchange.question == asked for exchange in step.state.exchanges):  # the answer named no other
            raise MissionEnd("object_unknown", why)
        return await ask_customer(step, "unknown_object", asked, "object_unknown", why)
    return PlaceDrone()


async def place_drone(step: Step) -> TakeStand:
    """The drone of this mission's key, in the air. Raises MissionEnd (stopped_by_guard) where it may not take off from
    where it stands; PortError."""
    step.enter("place", "placing the drone")
    vehicle = await step.timed("place", step.context.placement.begin(step.state.key))
    step.update(vehicle=vehicle.name)
    state = await vehicle.state()
    if state.mode == "landed":
        state = await _taken_off(step, vehicle, state)
    behind_guard = await guarded(vehicle, step.context.limits, step.state.guard)
    drone = Drone(behind_guard, await vehicle.connect())
    step.context = replace(step.context, drone=drone)
    step.update(drone=state, guard=behind_guard.memory, renderer=await step.context.placement.renderer(vehicle.name))
    step.write(
        f"the drone is at {spoken(state.pose)}: {drone.capabilities.kind}",
        PlacedData(vehicle=vehicle.name, vehicle_kind=drone.capabilities.kind, pose=state.pose, cameras=drone.cameras),
    )
    return TakeStand()


async def _taken_off(step: Step, vehicle: Vehicle, stands: VehicleState) -> VehicleState:
    """Behind a guard of its own: where the mission starts is where the take-off ends."""
    height_m = step.settings.take_off_height_m
    try:
        return await (await guarded(vehicle, step.context.limits, None)).take_off(height_m)
    except FlightRefused as refusal:
        up = Point3(x=stands.pose.x, y=stands.pose.y, z=stands.pose.z + height_m)
        refused = RefusedData(reason=refusal.reason, at=refusal.at, path=(up,), action="none")
        step.write(f"the flight guard refused the take-off: {refusal.message}", refused)
        why = f"stopped for safety: {refusal.message}; the drone did not take off"
        raise MissionEnd("stopped_by_guard", why) from None

"""What a request leaves open reaches the customer, and the answer goes on with the mission."""

import asyncio
import itertools
from dataclasses import replace
from datetime import UTC, datetime, timedelta

from contracts.llm_parser import ParseAnswer, ParseQuestion, Reasons, Relation
from contracts.orchestrator import DeliveryResult, MissionSettings, OpenQuestion
from mission.advance import advance
from mission.customer import AnsweredBeforehand, Customer
from mission.mission import Mission
from mission.policies import completed
from mission.ports import Parser
from mission.questions import left_open, question_of
from mission.stage_actions.asking import MAX_QUESTIONS
from mission.stages import Ended, NeedsAnswer
from mission.state import MissionState, begin
from mission.step import MissionContext
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import BlockVision, block_placement, block_ports
from tests.mission.test_carried_on import Numbered, context_of, edges
from tests.mission.test_mission import REQUEST, Events

VAGUE = "Please come to the window with the green flower pot"
SETTINGS = completed(MissionSettings())
GERMAN = ParseAnswer(
    missing=("floor", "object"),
    reasons=Reasons(floor="other_language", object="other_language"),
    question="Ich lese nur Englisch; bitte schreiben Sie Stockwerk und Merkmal auf Englisch.",
    language="de",
    model="scripted",
)
BY_NEIGHBOUR = ParseAnswer(
    floor=4,
    missing=("object",),
    reasons=Reasons(object="relation_only"),
    relation=Relation(to="red teapot", side="left"),
    model="scripted",
)


class Silent:
    """Is asked, and says nothing."""

    def __init__(self, patience_s: float) -> None:
        self.patience_s = patience_s

    async def answer(self, number: int, question: OpenQuestion) -> str | None:
        await asyncio.Event().wait()
        return None


class Says:
    """A parser that answers with `first`, and understands everything once an answer is there."""

    def __init__(self, first: ParseAnswer) -> None:
        self.first = first
        self.heard: list[ParseQuestion] = []

    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        self.heard.append(question)
        if question.exchanges:
            return ParseAnswer(floor=4, object="green flower pot", model="scripted")
        return self.first


async def fly(
    request: str,
    customer: Customer | None,
    *,
    world: BlockWorld | None = None,
    vision: BlockVision | None = None,
    parser: Parser | None = None,
    log: Events | None = None,
) -> DeliveryResult:
    world = world or BlockWorld()
    ports = block_ports(world, vision, parser=parser)
    events = log if log is not None else Events()
    return await Mission(ports, block_placement(world), SETTINGS, events, customer=customer).fly(request)


async def test_the_answer_to_what_was_left_open_is_read_with_the_request() -> None:
    log = Events()
    result = await fly(VAGUE, AnsweredBeforehand(["it is on floor 4"]), log=log)
    assert (result.outcome, result.floor, result.object) == ("delivered", 4, "green flower pot")
    asked, answered = log.of("question")[0].data, log.of("answer")[0].data
    assert (asked.topic, asked.text) == ("request", "Which floor is the window on?")
    assert (answered.question, answered.text) == (asked.text, "it is on floor 4")
    assert "answer" in result.timings_s


async def test_an_answer_may_leave_the_rest_open_which_is_asked_next() -> None:
    log = Events()
    result = await fly("hello", AnsweredBeforehand(["floor 4", "the green flower pot"]), log=log)
    assert result.outcome == "delivered"
    assert [event.data.text for event in log.of("question")] == [
        "Which floor is the window on? What can be seen at your window from outside?",
        "What can be seen at your window from outside?",
    ]


async def test_without_a_customer_nothing_is_asked_and_the_end_says_the_question() -> None:
    log, world = Events(), BlockWorld()
    result = await fly(VAGUE, None, log=log, world=world)
    assert result.outcome == "request_incomplete"
    assert result.message == "the request names no floor: Which floor is the window on?"
    assert log.of("question") == []
    assert not world.live


async def test_an_answer_that_does_not_come_in_time_ends_the_mission_with_the_question() -> None:
    world = BlockWorld()
    result = await fly(VAGUE, Silent(0.05), world=world)
    assert result.outcome == "request_incomplete"
    assert result.message.startswith("no answer came within")
    assert "Which floor is the window on?" in result.message
    assert not world.live
    assert not world.ended


async def test_with_no_time_to_answer_nobody_is_asked() -> None:
    log = Events()
    result = await fly(VAGUE, Silent(0.0), log=log)
    assert (result.outcome, log.of("question")) == ("request_incomplete", [])


async def test_answers_given_beforehand_that_do_not_suffice_end_the_mission_at_once() -> None:
    result = await fly("hello", AnsweredBeforehand(["floor 4"]))
    assert result.outcome == "request_incomplete"
    assert result.message == "the request names no object at the window: What can be seen at your window from outside?"


async def test_answers_that_never_settle_it_end_the_mission_after_a_few() -> None:
    log = Events()
    result = await fly(VAGUE, AnsweredBeforehand(["I don't know"] * 20), log=log)
    assert result.outcome == "request_incomplete"
    assert f"{MAX_QUESTIONS} answers did not settle it" in result.message
    assert len(log.of("question")) == MAX_QUESTIONS


async def test_something_else_at_the_window_is_asked_for_where_the_model_has_never_learnt_the_thing() -> None:
    world, log = BlockWorld(), Events()
    vision = BlockVision(world, unknown=frozenset({"old brass gramophone"}))
    customer = AnsweredBeforehand(["yes, the green flower pot"])
    result = await fly("floor 4, the old brass gramophone", customer, world=world, vision=vision, log=log)
    assert (result.outcome, result.object) == ("delivered", "green flower pot")
    question = log.of("question")[0].data
    assert question.topic == "unknown_object"
    assert question.text.startswith("I have never learnt to recognise an old brass gramophone.")


async def test_a_thing_never_learnt_without_another_ends_on_the_ground_as_unknown() -> None:
    world = BlockWorld()
    vision = BlockVision(world, unknown=frozenset({"green flower pot"}))
    log = Events()
    result = await fly(REQUEST, AnsweredBeforehand(["no", "no", "no"]), world=world, vision=vision, log=log)
    assert (result.outcome, world.ended) == ("object_unknown", [])
    assert len(log.of("question")) == 1, "a customer who has said no is not asked the same again"


async def test_another_language_is_told_in_it_and_never_as_a_request_that_names_no_floor() -> None:
    log, parser = Events(), Says(GERMAN)
    customer = AnsweredBeforehand(["floor 4, the green flower pot"])
    result = await fly("Im vierten Stock", customer, parser=parser, log=log)
    assert result.outcome == "delivered"
    assert log.of("question")[0].data.text == GERMAN.question
    assert [[exchange.question for exchange in heard.exchanges] for heard in parser.heard] == [[], [GERMAN.question]]
    unasked = await fly("Im vierten Stock", None, parser=Says(GERMAN))
    assert unasked.message == f"the request is not in English: {GERMAN.question}"


async def test_a_window_described_by_its_neighbour_is_asked_for_a_mark_of_its_own() -> None:
    log = Events()
    result = await fly("left of the teapot", AnsweredBeforehand(["a pot"]), parser=Says(BY_NEIGHBOUR), log=log)
    assert result.outcome == "delivered"
    asked = "Your window is left of the one with the red teapot: what can be seen at your own?"
    assert log.of("question")[0].data.text == asked


def test_what_is_open_is_said_by_its_reason() -> None:
    floor_open = ParseAnswer(object="pot", missing=("floor",), reasons=Reasons(floor="open"), model="m")
    assert left_open(floor_open) == "the request leaves the floor open"
    assert left_open(BY_NEIGHBOUR) == "the request marks the window only by a neighbouring one"
    assert question_of(floor_open.model_copy(update={"question": ""})) == "Which floor is the window on?"
    own = "Is it the 4th or the 5th?"
    assert question_of(floor_open.model_copy(update={"question": own})) == own


async def test_how_a_first_floor_counts_goes_to_the_parser() -> None:
    parser, world = Says(GERMAN), BlockWorld()
    settings = MissionSettings(ground_floor=0)
    await Mission(block_ports(world, parser=parser), block_placement(world), settings, Events()).fly("first floor")
    assert parser.heard[0].ground_floor == 0


def asked_of(customer: Customer, world: BlockWorld, log: Numbered) -> MissionContext:
    return replace(context_of(world, SETTINGS, log), customer=customer)


async def test_a_mission_cut_while_it_waits_is_carried_on_and_asks_the_same_question_once() -> None:
    customer, world, log = AnsweredBeforehand(["floor 4"]), BlockWorld(), Numbered()
    state = begin(VAGUE, "m")
    while not state.over:
        written = MissionState.model_validate_json(state.model_dump_json())
        await advance(written, asked_of(customer, world, log))  # its process died before the state was written
        state = await advance(written, asked_of(customer, world, log))
    assert isinstance(state.stage, Ended)
    assert state.stage.outcome == "delivered"
    assert len(state.exchanges) == 1
    assert sum(message.startswith("asks the customer") for _, message in log.told) == 1


async def test_a_mission_with_questions_goes_only_where_the_diagram_leads() -> None:
    for answers in (["floor 4"], []):
        context = asked_of(AnsweredBeforehand(answers), BlockWorld(), Numbered())
        states = [begin(VAGUE, "m")]
        while not states[-1].over:
            states.append(await advance(states[-1], context))
        for before, after in itertools.pairwise(states):
            assert (before.stage.at, after.stage.at) in edges()


async def test_a_waiting_mission_can_be_cancelled() -> None:
    mission = asyncio.create_task(fly(VAGUE, Silent(60.0)))
    await asyncio.sleep(0.1)
    mission.cancel()
    assert (await mission).outcome == "cancelled"


async def test_a_drone_in_the_air_holds_while_the_customer_is_asked() -> None:
    world, log = BlockWorld(), Numbered()
    context = context_of(world, SETTINGS, log)
    state = begin(REQUEST, "m")
    while state.drone is None or state.drone.moves < 2:
        state = await advance(state, context)
    question = OpenQuestion(topic="request", text="Which one?", answer_by=datetime.now(UTC) + timedelta(seconds=60))
    end = Ended(outcome="request_incomplete", message="Which one?")
    waiting = state.model_copy(update={"stage": NeedsAnswer(question=question, unanswered=end), "flight": None})
    customer = AnsweredBeforehand(["floor 4"])
    after = await advance(waiting, replace(context, customer=customer))
    vehicle = next(iter(world.vehicles.values()))
    assert vehicle.holds == 1
    assert after.drone is not None
    assert after.drone.moves == state.drone.moves
    assert after.exchanges[0].answer == "floor 4"

"""Questions to the customer: asked once, waited for, their answers kept with the mission."""

import asyncio
from datetime import UTC, datetime, timedelta

from contracts.event_data import AnswerData
from contracts.llm_parser import Exchange
from contracts.orchestrator import OpenQuestion, OutcomeName, QuestionTopic
from mission.stages import Ended, NeedsAnswer, ReadRequest
from mission.step import MissionEnd, Step
from mission.wording import spoken_duration

MAX_QUESTIONS = 4
"""A customer who was asked so often can't be helped by another question."""


async def ask_customer(step: Step, topic: QuestionTopic, text: str, unanswered: OutcomeName, why: str) -> NeedsAnswer:
    """Asks, and waits in the next step. Raises MissionEnd (`unanswered`, with `why`) where nobody is there to answer,
    or too much was asked already."""
    customer = step.context.customer
    end = Ended(outcome=unanswered, message=why)
    if customer is None or customer.patience_s <= 0.0:
        raise MissionEnd(end.outcome, end.message)
    if len(step.state.exchanges) >= MAX_QUESTIONS:
        raise MissionEnd(end.outcome, f"{end.message} ({MAX_QUESTIONS} answers did not settle it)")
    answer_by = datetime.now(UTC) + timedelta(seconds=customer.patience_s)
    question = OpenQuestion(topic=topic, text=text, answer_by=answer_by)
    step.write(f"asks the customer: {text}", question)
    return NeedsAnswer(question=question, unanswered=end)


async def wait_for_answer(step: Step, stage: NeedsAnswer) -> ReadRequest:
    """Raises MissionEnd where no answer comes in time; PortError. A drone in the air holds meanwhile."""
    if step.context.drone is not None:
        await step.drone.vehicle.hold()
    text = await step.timed("answer", _answer(step, stage))
    exchange = Exchange(question=stage.question.text, answer=text)
    step.update(exchanges=(*step.state.exchanges, exchange))
    step.write(f"the customer answers: {text}", AnswerData(question=stage.question.text, text=text))
    return ReadRequest()


async def _answer(step: Step, stage: NeedsAnswer) -> str:
    customer, end = step.context.customer, stage.unanswered
    text: str | None = None
    if customer is not None:
        left_s = (stage.question.answer_by - datetime.now(UTC)).total_seconds()
        try:
            async with asyncio.timeout(max(0.0, left_s)):
                text = await customer.answer(len(step.state.exchanges) + 1, stage.question)
        except TimeoutError:
            waited = spoken_duration(customer.patience_s)
            raise MissionEnd(end.outcome, f"no answer came within {waited}: {end.message}") from None
    if text is None or not text.strip():
        raise MissionEnd(end.outcome, end.message)
    return text.strip()

"""The customer of a task: what they answer, and that being asked is counted."""

from datetime import UTC, datetime

from contracts.llm_parser import Exchange, ParseQuestion
from contracts.orchestrator import OpenQuestion, QuestionTopic
from evaluation.bench.customer import TaskCustomer
from evaluation.metrics.summary import summarize
from services.llm_parser.reader.model import ReaderModel
from services.llm_parser.reader.parser import WEIGHTS, ReaderParser
from tests.evaluation.evaluation_kit import a_record, a_task, delivered


def a_question(topic: QuestionTopic = "request") -> OpenQuestion:
    return OpenQuestion(topic=topic, text="Which floor is the window on?", answer_by=datetime.now(UTC))


async def test_a_customer_says_floor_and_thing_of_the_task_and_counts_the_questions() -> None:
    customer = TaskCustomer(a_task(floor=4))
    assert await customer.answer(1, a_question()) == "Floor 4. At my window you see a green flower pot."
    assert await customer.answer(1, a_question()) is not None
    assert customer.asked == 1


async def test_a_customer_has_no_other_thing_at_the_window() -> None:
    assert await TaskCustomer(a_task()).answer(1, a_question("unknown_object")) is None


async def test_the_reader_understands_the_customer() -> None:
    task = a_task(floor=4)
    said = await TaskCustomer(task).answer(1, a_question())
    exchange = Exchange(question="Which floor, and what can be seen?", answer=said or "")
    asked = ParseQuestion(request="Please bring me my parcel.", exchanges=(exchange,))
    answer = await ReaderParser(ReaderModel(WEIGHTS)).parse(asked)
    assert (answer.floor, answer.object) == (task.floor, task.object)


def test_a_run_tells_in_how_many_episodes_somebody_was_asked() -> None:
    tasks = {name: a_task(name) for name in ("a", "b", "c")}
    records = [
        a_record(tasks[name], delivered()).model_copy(update={"questions": n})
        for name, n in (("a", 0), ("b", 2), ("c", 1))
    ]
    assert summarize(tasks, records, 1.0).asked == 2

"""A run through an orchestrator: what becomes of each delivery."""

import pytest

from contracts.orchestrator import Delivery, DeliveryResult
from evaluation.task_set.task_files import BadTasks
from logisticsvln.bench import RemoteBench
from tests.evaluation.evaluation_kit import a_result


def ended(result: DeliveryResult | None) -> Delivery:
    return Delivery(
        id="one", status="done", phase="done", request="a kite", scene=None, created="now", folder=None, result=result
    )


@pytest.mark.parametrize(
    ("result", "error"),
    [
        (a_result("failed"), a_result("failed").message),
        (None, "the orchestrator has no result of it"),
        (a_result("delivered"), None),
    ],
)
def test_a_delivery_that_broke_says_what_broke(result: DeliveryResult | None, error: str | None) -> None:
    bench = RemoteBench("vld-300", "oracle", None, 1, None)
    (order,) = bench.orders()
    bench.ordered(order.task, ended(result))
    bench.done(ended(result))
    (record,) = bench.result().records
    assert record.error == error


def test_a_run_of_no_tasks_is_refused() -> None:
    with pytest.raises(BadTasks, match="limit: 0 tasks are none"):
        RemoteBench("vld-300", "oracle", None, 0, None)

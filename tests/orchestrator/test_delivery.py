"""Orders read back from records."""

from pathlib import Path

from contracts.orchestrator import Delivery, DeliveryQuestion
from mission.record import Record, now
from orchestrator import sample_library
from orchestrator.delivery import Order


def recorded(folder: Path, question: DeliveryQuestion) -> Order:
    delivery = Delivery(
        id=folder.name, status="waiting", phase="parse", request="r", scene="s", created=now(), folder=None
    )
    Record(folder, delivery, question).close()
    return Order.recorded(folder)


def test_the_record_of_a_sample_that_is_no_longer_there_is_flown_as_a_request_of_one_s_own(tmp_path: Path) -> None:
    sample = sample_library.load("green-flower-pot")
    question = DeliveryQuestion(sample="green-flower-pot", scene=sample.scene, request=sample.request)
    assert not recorded(tmp_path / "known", question).own_request
    gone = recorded(tmp_path / "gone", question.model_copy(update={"sample": "sold-out"}))
    assert gone.own_request
    assert gone.scene == sample.scene

"""The record: append-only, readable after a crash, never half a result."""

import json
from pathlib import Path

import pytest

from contracts.event_data import LostData, NoData
from contracts.events import Event, LookEvent, UnknownEvent
from contracts.geometry import Point3
from contracts.orchestrator import Delivery, DeliveryQuestion
from mission.clients import Simulated
from mission.policies import completed
from mission.record import DELIVERY_ID, PICTURE_NAME, BadRecord, Record, new_id, read_delivery, read_events, read_state
from mission.state import begin
from orchestrator.delivery import Order, Run
from orchestrator.summary import draw_summary
from tests.mission.block import Block, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_ports


def record_in(folder: Path, **options: object) -> Record:
    delivery = Delivery(
        id=new_id(), status="waiting", phase="parse", request="r", scene="s", created="now", folder=str(folder)
    )
    return Record(folder, delivery, DeliveryQuestion(request="r", sample="s"), **options)


def test_events_are_on_disk_before_anybody_hears_of_them(tmp_path: Path) -> None:
    heard: list[int] = []

    def listen(event: Event) -> None:
        heard.append(len(read_events(tmp_path / "d")))

    record = record_in(tmp_path / "d", listener=listen)
    record.write(1, "parse", "one", NoData())
    lost = LostData(place=Point3(x=0.0, y=0.0, z=0.0), blocked=True)
    record.write(2, "approach", "two", lost, lambda: {"view": b"\xff\xd8 not really"})
    record.close()
    assert heard == [1, 2]
    event = read_events(tmp_path / "d")[1]
    assert event.pictures == ("0002_view.jpg",)
    assert (tmp_path / "d" / "pictures" / event.pictures[0]).read_bytes() == b"\xff\xd8 not really"


def test_a_line_that_a_crash_cut_off_ends_the_events_and_the_delivery_has_failed(tmp_path: Path) -> None:
    record = record_in(tmp_path / "d")
    record.write(1, "parse", "one", NoData())
    record.close()
    with (tmp_path / "d" / "events.jsonl").open("a") as file:
        file.write('{"number":2,"time_s":1.0,"pha')
    assert [e.number for e in read_events(tmp_path / "d")] == [1]
    delivery = read_delivery(tmp_path / "d")
    assert delivery is not None
    assert delivery.result is not None
    assert delivery.result.outcome == "failed"


def test_a_folder_is_never_written_twice(tmp_path: Path) -> None:
    record_in(tmp_path / "d").close()
    with pytest.raises(FileExistsError):
        record_in(tmp_path / "d")


def test_ids_and_picture_names_are_safe_in_paths() -> None:
    assert DELIVERY_ID.fullmatch(new_id())
    for evil in ("../x", "a/b", "", "20250101-000000-abcdef/..", "20250101-000000-abcdef\n"):
        assert not DELIVERY_ID.fullmatch(evil), evil
        assert not PICTURE_NAME.fullmatch(evil), evil


async def test_everything_about_a_delivery_can_be_read_from_its_folder_alone(tmp_path: Path) -> None:
    world = BlockWorld(Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0)))
    question = DeliveryQuestion(request="floor 4, the green flower pot", scene=block_scene(world.block))
    run = Run(Order(question), tmp_path)
    result = await run.fly(Simulated(block_ports(world), world))
    folder = run.record.folder
    delivery = read_delivery(folder)
    assert delivery is not None
    assert delivery.result == result
    asked = DeliveryQuestion.model_validate_json((folder / "question.json").read_text())
    assert asked.scene == question.scene
    assert asked.settings == completed(question.settings)
    named = {p for e in read_events(folder) for p in e.pictures}
    assert named == {p.name for p in (folder / "pictures").iterdir()}
    looks = [e for e in read_events(folder) if isinstance(e, LookEvent)]
    assert looks
    assert all(look.picture(view.picture) for look in looks for view in look.data.views)
    (folder / "summary.png").unlink()
    assert draw_summary(folder).stat().st_size > 10_000


def test_a_result_of_the_first_version_still_reads(tmp_path: Path) -> None:
    record_in(tmp_path / "d").close()
    lines = (Path(__file__).parents[1] / "data" / "records" / "events-0.1.jsonl").read_text(encoding="utf-8")
    told = next(event for event in map(json.loads, lines.splitlines()) if event["kind"] == "result")
    (tmp_path / "d" / "result.json").write_text(json.dumps(told["data"]))
    delivery = read_delivery(tmp_path / "d")
    assert delivery is not None
    assert delivery.result is not None
    assert (delivery.result.outcome, delivery.result.steps) == (told["data"]["outcome"], told["data"]["steps"])


def test_a_record_that_was_left_is_reopened_at_its_last_whole_event(tmp_path: Path) -> None:
    left = record_in(tmp_path / "d")
    left.write(1, "parse", "one", NoData())
    left.write(2, "parse", "two", NoData())
    left.close()
    path = tmp_path / "d" / "events.jsonl"
    path.write_bytes(path.read_bytes() + b'{"number":3,"time_s":1.0,"pha')
    heard: list[int] = []
    record = Record.reopened(tmp_path / "d", listener=lambda event: heard.append(event.number))
    for number in (2, 3):  # the step that was cut off is done again
        record.write(number, "parse", f"again {number}", NoData())
    with pytest.raises(ValueError, match="event 5 can't follow event 3"):
        record.write(5, "parse", "a gap", NoData())
    record.close()
    events = read_events(tmp_path / "d")
    assert [(e.number, e.message) for e in events] == [(1, "one"), (2, "two"), (3, "again 3")]
    assert heard == [3]
    assert events[2].time_s >= events[1].time_s


def test_only_a_record_can_be_reopened(tmp_path: Path) -> None:
    with pytest.raises(BadRecord, match=r"is not the record of a delivery: it has no delivery\.json"):
        Record.reopened(tmp_path)
    (tmp_path / "delivery.json").write_text("{}")
    with pytest.raises(ValueError, match="Field required"):
        Record.reopened(tmp_path)
    assert not (tmp_path / "events.jsonl").exists()


def test_a_state_is_read_as_it_was_kept_and_one_of_another_version_is_refused(tmp_path: Path) -> None:
    assert read_state(tmp_path) is None
    record = record_in(tmp_path / "d")
    state = begin("floor 4, the green flower pot")
    record.keep(state)
    record.close()
    assert read_state(tmp_path / "d") == state
    path = tmp_path / "d" / "state.json"
    path.write_text(path.read_text().replace('"version":1', '"version":2'))
    for damaged in (path.read_bytes().replace(b'"version":1', b'"version":2'), b"", b'{"a', b"\xff\xfe"):
        path.write_bytes(damaged)
        with pytest.raises(BadRecord, match=r"state\.json is damaged or of another version"):
            read_state(tmp_path / "d")


def test_an_event_of_an_unknown_kind_does_not_end_the_record(tmp_path: Path) -> None:
    record = record_in(tmp_path / "d")
    record.write(1, "parse", "one", NoData())
    record.close()
    newer = {"number": 2, "time_s": 1.0, "phase": "charging", "kind": "charged", "message": "full", "data": {"v": 1}}
    last = {"number": 3, "time_s": 2.0, "phase": "parse", "kind": "phase", "message": "three", "data": {}}
    with (tmp_path / "d" / "events.jsonl").open("a") as file:
        file.write(json.dumps(newer) + "\n" + json.dumps(last) + "\n")
    events = read_events(tmp_path / "d")
    assert [(e.number, e.kind, e.message) for e in events[1:]] == [(2, "charged", "full"), (3, "phase", "three")]
    assert isinstance(events[1], UnknownEvent)
    assert events[1].data == {"v": 1}


def test_line_separators_in_a_customers_words_do_not_end_an_event(tmp_path: Path) -> None:
    words = "fourth floor,\u2028the window\u0085with the\u2029green flower pot"
    record = record_in(tmp_path / "d")
    record.write(1, "parse", words, NoData())
    record.write(2, "parse", "two", NoData())
    record.close()
    assert [event.message for event in read_events(tmp_path / "d")] == [words, "two"]
    Record.reopened(tmp_path / "d").close()
    assert [event.message for event in read_events(tmp_path / "d")] == [words, "two"]


def test_an_event_that_lost_only_the_end_of_its_line_is_written_again_on_a_line_of_its_own(tmp_path: Path) -> None:
    left = record_in(tmp_path / "d")
    left.write(1, "parse", "one", NoData())
    left.write(2, "parse", "two", NoData())
    left.close()
    path = tmp_path / "d" / "events.jsonl"
    path.write_bytes(path.read_bytes()[:-1])
    record = Record.reopened(tmp_path / "d")
    record.write(2, "parse", "two again", NoData())
    record.write(3, "parse", "three", NoData())
    record.close()
    assert [event.message for event in read_events(tmp_path / "d")] == ["one", "two again", "three"]


def test_a_record_that_somebody_still_writes_is_not_carried_on(tmp_path: Path) -> None:
    first = record_in(tmp_path / "d")
    first.write(1, "parse", "one", NoData())
    with pytest.raises(BadRecord, match="is written by another process"):
        Record.reopened(tmp_path / "d")
    first.write(2, "parse", "two", NoData())
    first.close()
    Record.reopened(tmp_path / "d").close()
    assert [event.message for event in read_events(tmp_path / "d")] == ["one", "two"]


async def test_a_delivery_that_is_done_is_not_flown_again(tmp_path: Path) -> None:
    world = BlockWorld(Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0)))
    run = Run(
        Order(DeliveryQuestion(request="floor 4, the green flower pot", scene=block_scene(world.block))), tmp_path
    )
    services = Simulated(block_ports(world), world)
    result = await run.fly(services)
    folder = run.record.folder
    told = (folder / "events.jsonl").read_bytes()
    (folder / "state.json").unlink()  # as in records of the first version
    assert await Run.reopened(folder).fly(services) == result
    assert (folder / "events.jsonl").read_bytes() == told


def test_a_record_that_has_lost_its_events_or_its_state_is_refused(tmp_path: Path) -> None:
    record = record_in(tmp_path / "d")
    record.write(1, "explore", "on its way", NoData())
    with pytest.raises(BadRecord, match=r"events of a flight, but no state\.json"):
        read_state(tmp_path / "d")
    record.keep(begin("floor 4, the green flower pot").model_copy(update={"events": 2}))
    record.close()
    with pytest.raises(BadRecord, match=r"was written after event 2, its events\.jsonl ends with event 1"):
        read_state(tmp_path / "d")


def test_a_record_with_a_damaged_line_amid_its_events_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    record = record_in(tmp_path / "d")
    for number in (1, 2, 3):
        record.write(number, "parse", f"event {number}", NoData())
    record.close()
    path = tmp_path / "d" / "events.jsonl"
    lines = path.read_bytes().split(b"\n")
    damaged = b"\n".join([lines[0], b"garbage", *lines[2:]])
    path.write_bytes(damaged)
    with pytest.raises(BadRecord, match=r"line 2 of .*events\.jsonl is no event"):
        Record.reopened(tmp_path / "d")
    assert path.read_bytes() == damaged

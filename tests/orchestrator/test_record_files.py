"""What the files of records promise, in a folder and in a bucket."""

from pathlib import Path

import pytest
from obstore.store import MemoryStore

from orchestrator.bucket_files import Bucket, BucketFiles, opened
from orchestrator.record_files import FolderFiles, RecordFiles, shown_file
from orchestrator.summary import draw_summary
from service_kit.settings import BadSetting
from tests.conftest import free_port
from tests.mission.block_vehicle import BlockWorld
from tests.orchestrator.orders import events_of, finished, order


@pytest.fixture(params=["folder", "bucket"])
def files(request: pytest.FixtureRequest, tmp_path: Path) -> RecordFiles:
    return FolderFiles(tmp_path) if request.param == "folder" else BucketFiles(MemoryStore(), "s3://records")


def check_files(files: RecordFiles) -> None:
    assert files.problem() is None
    assert (files.read("a", "result.json"), files.size("a")) == (None, 0)
    files.delete("a")
    files.write("a", {f"pictures/{k:04d}_view.jpg": bytes([k]) * 10 for k in range(1, 30)})
    files.write("a", {"result.json": b"{}"})
    files.write("a", {"result.json": b"[1]"})
    files.write("ab", {"result.json": b"of another"})
    assert files.read("a", "result.json") == b"[1]"
    assert files.read("a", "pictures/0007_view.jpg") == bytes([7]) * 10
    assert (files.read("a", "pictures"), files.read("a", "pictures/0030_view.jpg")) == (None, None)
    assert files.size("a") == 29 * 10 + 3
    files.delete("a")
    assert (files.read("a", "result.json"), files.size("a")) == (None, 0)
    assert files.read("ab", "result.json") == b"of another"


def test_what_is_written_is_read_sized_and_deleted_and_no_other_delivery_s(files: RecordFiles) -> None:
    check_files(files)


def test_only_files_that_may_be_shown_are(files: RecordFiles) -> None:
    files.write("a", {"delivery.json": b"{}", "result.json": b"{}", "pictures/0001_view.jpg": b"jpeg"})
    shown = [shown_file(files, "a", name) for name in ("result.json", "0001_view.jpg")]
    assert [one and tuple(one) for one in shown] == [("result.json", b"{}"), ("0001_view.jpg", b"jpeg")]
    for name in ("delivery.json", "pictures/0001_view.jpg", "../a/result.json", "0002_view.jpg", "summary.png"):
        assert shown_file(files, "a", name) is None, name


def test_the_summary_of_a_delivery_tells_its_own_result(door, runs: Path) -> None:
    world = BlockWorld()
    client = door(world)
    name = client.post("/v1/deliveries", json=order(world)).json()["id"]
    finished(client, name)
    shown = client.get(f"/v1/deliveries/{name}/files/summary.png").content
    assert shown == draw_summary(runs / name).read_bytes(), "drawn again from the finished record it is the same"


def check_a_delivery_in(files: BucketFiles, door, runs: Path) -> None:
    """It leaves its record in the bucket, and nothing in the folder."""
    world = BlockWorld()
    client = door(world, files=files)
    name = client.post("/v1/deliveries", json=order(world)).json()["id"]
    pictures = [picture for event in events_of(client, name) for picture in event.pictures]
    assert pictures
    for picture in pictures:
        assert client.get(f"/v1/deliveries/{name}/files/{picture}").content == files.read(name, f"pictures/{picture}")
    for file in ("summary.png", "events.jsonl", "result.json", "question.json"):
        assert client.get(f"/v1/deliveries/{name}/files/{file}").content == files.read(name, file)
    assert finished(client, name).folder == files.place(name)
    assert not (runs / name).exists()


def test_a_delivery_s_record_lies_in_the_bucket_and_nothing_in_the_folder(door, runs: Path) -> None:
    check_a_delivery_in(BucketFiles(MemoryStore(), "s3://records"), door, runs)


def test_a_bucket_that_does_not_answer_is_trouble_with_a_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orchestrator.bucket_files.RETRIES", 0)
    files = opened(Bucket("s3://records", f"http://127.0.0.1:{free_port()}", "us-east-1", "id", "key"))
    for call in (
        lambda: files.read("a", "result.json"),
        lambda: files.write("a", {"result.json": b"{}"}),
        lambda: files.size("a"),
        lambda: files.delete("a"),
    ):
        with pytest.raises(OSError, match="the bucket of the records: "):
            call()
    assert "error sending request" in str(files.problem())


def test_a_folder_that_is_not_there_is_a_problem(tmp_path: Path) -> None:
    assert FolderFiles(tmp_path / "runs").problem() == f"{tmp_path / 'runs'} is no folder that can be written"


@pytest.mark.parametrize("url", ["records", "https://records", "s3://", "s3:/records", "s3://records?x=1"])
def test_an_address_that_is_no_bucket_is_refused(url: str) -> None:
    with pytest.raises(BadSetting, match="give s3://bucket or s3://bucket/prefix"):
        opened(Bucket(url))


def test_half_a_key_is_refused() -> None:
    with pytest.raises(BadSetting, match="AWS_SECRET_ACCESS_KEY belong together"):
        opened(Bucket("s3://records", key_id="id"))

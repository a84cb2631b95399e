"""Records in a bucket of a server that speaks S3, moto's, from an environment of its own (`make test-s3`)."""

import contextlib
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from orchestrator.bucket_files import Bucket, opened
from tests.conftest import free_port
from tests.ending import WITH_THE_TESTS
from tests.orchestrator.test_record_files import check_a_delivery_in, check_files

SERVER = Path(__file__).parents[2] / ".cache" / "s3" / "bin" / "moto_server"
START_WITHIN_S = 60.0


@pytest.fixture
def bucket(tmp_path: Path) -> Iterator[Bucket]:
    """A bucket of its own, with a prefix."""
    port = free_port()
    with (tmp_path / "moto.log").open("wb") as log:
        command = [*WITH_THE_TESTS, str(SERVER), "-H", "127.0.0.1", "-p", str(port)]
        server = subprocess.Popen(command, stdout=log, stderr=log)
    url, give_up = f"http://127.0.0.1:{port}", time.monotonic() + START_WITHIN_S
    while True:
        with contextlib.suppress(httpx.TransportError):
            httpx.put(f"{url}/records").raise_for_status()
            break
        assert time.monotonic() < give_up, (tmp_path / "moto.log").read_text()
        time.sleep(0.1)
    yield Bucket("s3://records/drones/one", url, "us-east-1", "id", "key")
    server.terminate()
    server.wait(10)


@pytest.mark.s3
def test_files_in_a_bucket_are_as_those_in_a_folder(bucket: Bucket) -> None:
    check_files(opened(bucket))


@pytest.mark.s3
def test_files_lie_below_the_prefix_under_the_delivery_s_name(bucket: Bucket) -> None:
    opened(bucket).write("a", {"pictures/0001_view.jpg": b"jpeg"})
    listed = httpx.get(f"{bucket.endpoint}/records", params={"list-type": "2"}).text
    assert "<Key>drones/one/a/pictures/0001_view.jpg</Key>" in listed
    assert opened(bucket).place("a") == "s3://records/drones/one/a"


@pytest.mark.s3
def test_more_files_than_one_answer_lists_are_all_sized_and_deleted(bucket: Bucket) -> None:
    files = opened(bucket)
    files.write("a", {f"pictures/{k:04d}_view.jpg": b"jpeg" for k in range(1, 1101)})
    assert files.size("a") == 4400
    files.delete("a")
    assert files.size("a") == 0


@pytest.mark.s3
def test_a_bucket_that_is_not_there_is_trouble_with_a_disk(bucket: Bucket) -> None:
    files = opened(bucket._replace(url="s3://other"))
    with pytest.raises(OSError, match="the bucket of the records: "):
        files.write("a", {"result.json": b"{}"})
    assert files.problem() == "there is no bucket s3://other"


@pytest.mark.s3
def test_an_orchestrator_keeps_its_deliveries_records_there(bucket: Bucket, door, runs: Path) -> None:
    check_a_delivery_in(opened(bucket), door, runs)

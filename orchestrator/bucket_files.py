"""Records in a bucket of an S3-compatible store, through obstore."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import urlsplit

import obstore
from obstore.exceptions import BaseError
from obstore.store import S3Store

from orchestrator.record_files import Files
from service_kit.settings import BadSetting

if TYPE_CHECKING:
    from obstore.store import ObjectStore, S3Config

AT_A_TIME = 8
"""Files of a record that are written at a time."""
REQUEST_S = 20.0
PROBE, NO_BUCKET = "none", "NoSuchBucket"
"""A file that there is not, and what S3 says where there is not even the bucket."""
RETRIES = 5
RETRIES_S = 30.0


class Bucket(NamedTuple):
    """`url`: `s3://bucket` or `s3://bucket/prefix`. What is null is looked for where AWS's programs look for it."""

    url: str
    endpoint: str | None = None
    region: str | None = None
    key_id: str | None = None
    key: str | None = None


def opened(bucket: Bucket) -> "BucketFiles":
    """Raises BadSetting for an address that is none; nobody is asked whether there is such a bucket."""
    parts = urlsplit(bucket.url)
    if parts.scheme != "s3" or not parts.netloc or parts.query or parts.fragment:
        raise BadSetting(f"RECORDS_URL={bucket.url}: give s3://bucket or s3://bucket/prefix")
    if (bucket.key_id is None) != (bucket.key is None):
        raise BadSetting("AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY belong together: set both or neither")
    given: S3Config = {}
    if bucket.endpoint is not None:
        given["endpoint"] = bucket.endpoint
    if bucket.region is not None:
        given["region"] = bucket.region
    if bucket.key_id is not None and bucket.key is not None:
        given["access_key_id"], given["secret_access_key"] = bucket.key_id, bucket.key
    store = S3Store(
        parts.netloc,
        prefix=parts.path.strip("/") or None,
        config=given,
        client_options={"allow_http": True, "timeout": timedelta(seconds=REQUEST_S)},
        retry_config={"max_retries": RETRIES, "retry_timeout": timedelta(seconds=RETRIES_S)},
    )
    return BucketFiles(store, bucket.url.rstrip("/"))


class BucketFiles:
    """Files are named `delivery/file`, below what `store` begins with; `url`: where that is, for people."""

    def __init__(self, store: "ObjectStore", url: str) -> None:
        self._store = store
        self._url = url
        self._writers = ThreadPoolExecutor(AT_A_TIME, thread_name_prefix="bucket")

    def place(self, delivery: str) -> str:
        return f"{self._url}/{delivery}"

    def problem(self) -> str | None:
        try:
            obstore.get(self._store, PROBE)
        except FileNotFoundError as error:  # as it should be, unless it is the bucket that is not there
            return f"there is no bucket {self._url}" if NO_BUCKET in str(error) else None
        except BaseError as error:
            return _reason(error)
        return None

    def write(self, delivery: str, files: Files) -> None:
        def put(file: str) -> None:
            with _as_oserror():
                obstore.put(self._store, f"{delivery}/{file}", files[file])

        list(self._writers.map(put, files))

    def read(self, delivery: str, file: str) -> bytes | None:
        with _as_oserror():
            try:
                return bytes(obstore.get(self._store, f"{delivery}/{file}").bytes())
            except FileNotFoundError:
                return None

    def size(self, delivery: str) -> int:
        return sum(size for _, size in self._listed(delivery))

    def delete(self, delivery: str) -> None:
        if names := [name for name, _ in self._listed(delivery)]:
            with _as_oserror():
                obstore.delete(self._store, names)

    def _listed(self, delivery: str) -> list[tuple[str, int]]:
        """Names and sizes."""
        with _as_oserror():
            found = obstore.list(self._store, f"{delivery}/")
            return [(str(one["path"]), one["size"]) for chunk in found for one in chunk]


@contextmanager
def _as_oserror() -> Iterator[None]:
    """The store's errors as those of a disk."""
    try:
        yield
    except (BaseError, FileNotFoundError) as error:  # the latter where there is no such bucket
        raise OSError(f"the bucket of the records: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    return str(error).strip().splitlines()[0][:300]

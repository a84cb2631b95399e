"""A webhook is told of every status, signed, and again until it takes the message."""

import base64
import hashlib
import hmac
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from contracts.orchestrator import StatusMessage
from orchestrator.webhooks import Webhook
from tests.mission.block_vehicle import BlockWorld
from tests.orchestrator.door import Door
from tests.orchestrator.orders import BEHIND, finished, order, patiently

SECRET = b"between us"


class Receiver(ThreadingHTTPServer):
    """Keeps what it is sent; refuses the first message it gets, once."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.tries: list[tuple[dict[str, str], bytes]] = []

    def times_first_was_sent(self) -> int:
        sent = [headers["webhook-id"] for headers, _ in self.tries]
        return sent.count(sent[0])

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/hook"


class _Handler(BaseHTTPRequestHandler):
    server: Receiver

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        self.server.tries.append(({name.lower(): value for name, value in self.headers.items()}, body))
        self.send_response(503 if len(self.server.tries) == 1 else 204)
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None: ...


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    server = Receiver()
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def test_a_webhook_hears_signed_how_a_delivery_stands_and_is_asked_again(receiver: Receiver, tmp_path: Path) -> None:
    began = int(time.time())
    door = Door(tmp_path / "runs", BlockWorld(BEHIND), webhook=Webhook(receiver.url, SECRET))
    try:
        name = door.client.post("/v1/deliveries", json=order(BlockWorld(BEHIND))).json()["id"]
        finished(door.client, name)
        patiently(lambda: any(b"delivery.done" in body for _, body in receiver.tries[1:]), "its end is not told")
        patiently(lambda: receiver.times_first_was_sent() > 1, "the refused one did not come again")
    finally:
        door.close()
    assert receiver.times_first_was_sent() == 2
    for headers, body in receiver.tries:
        signed = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.".encode() + body
        expected = base64.b64encode(hmac.new(SECRET, signed, hashlib.sha256).digest()).decode()
        assert headers["webhook-signature"] == f"v1,{expected}"
        assert began <= int(headers["webhook-timestamp"]) <= time.time()
    messages = [StatusMessage.model_validate_json(body) for _, body in receiver.tries]
    [done] = {m.data.result.outcome for m in messages if m.type == "delivery.done" and m.data.result}
    assert done == "delivered"
    assert {m.data.id for m in messages} == {name}

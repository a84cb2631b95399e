"""A model server for these tests: real HTTP, OpenAI's protocol, answers chosen by the test."""

import json
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest


class ModelServer:
    """Answers `POST /v1/chat/completions` with the chosen replies in turn, and keeps what it was asked."""

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self.headers: list[dict[str, str]] = []
        self._replies: list[tuple[int, bytes, float, dict[str, str]]] = []
        owner = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self._send(200, b'{"status": "ready", "service": "vlm_gateway"}')

            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                owner.asked.append(json.loads(body))
                owner.headers.append(dict(self.headers.items()))
                status, answer, delay_s, headers = owner._replies.pop(0)
                time.sleep(delay_s)
                self._send(status, answer, headers)

            def _send(self, status: int, body: bytes, headers: dict[str, str] | None = None) -> None:
                try:
                    self.send_response(status)
                    self.send_header("Content-Type", "application/json")
                    self.send_header("Content-Length", str(len(body)))
                    for name, value in (headers or {}).items():
                        self.send_header(name, value)
                    self.end_headers()
                    self.wfile.write(body)
                except (BrokenPipeError, ConnectionResetError):
                    self.close_connection = True

            def log_message(self, format: str, *args: Any) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}"
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.02})
        self._thread.start()

    def says(
        self,
        content: str | None,
        *,
        finish_reason: str = "stop",
        delay_s: float = 0.0,
        usage: object = None,
        headers: dict[str, str] | None = None,
        **message: Any,
    ) -> None:
        """The next reply is a completion with this content and these further fields of the message."""
        choice = {
            "index": 0,
            "finish_reason": finish_reason,
            "message": {"role": "assistant", "content": content, **message},
        }
        completion = {"id": "chatcmpl-1", "object": "chat.completion", "model": "m", "choices": [choice]}
        self.answers(200, completion | {"usage": usage}, delay_s=delay_s, headers=headers)

    def answers(
        self, status: int, body: object, *, delay_s: float = 0.0, headers: dict[str, str] | None = None
    ) -> None:
        """The next reply is this JSON with this status."""
        self._replies.append((status, json.dumps(body).encode(), delay_s, headers or {}))

    def fails(self, status: int, code: str, message: str = "as the test wants it") -> None:
        """The next reply is an error of the gateway's."""
        self.answers(status, {"error": {"code": code, "message": message, "details": {}}})

    def stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(5)


@pytest.fixture
def model_server() -> Iterator[ModelServer]:
    """A fresh server for each test."""
    server = ModelServer()
    yield server
    server.stop()

"""Small model servers that speak as the real ones do, each with its own quirks; and what a model says to our questions.

    server = QuirkyServer("lm-studio", answers)     # refuses json_object, tells errors as a bare string
    server.start(); server.asked; server.stop()

What each refuses and how it words its replies follows the sources named in presets/servers.toml.
"""

import asyncio
import contextlib
import json
import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, Self

from aiohttp import web

Brain = Callable[[str], str]
"""From all the words of a question to what the model says."""


def answers(words: str) -> str:
    """A model that sees three floors, the building in the middle, the object in the first view, and likes point a."""
    for sign, answer in (
        ('"floors"', {"floors": 3}),
        ('"matches"', {"found": True, "matches": [{"view": 1, "bbox": [0.1, 0.2, 0.5, 0.9], "confidence": 0.8}]}),
        ('"label"', {"label": "a"}),
        ('"bbox"', {"bbox": [0.25, 0.0, 0.75, 1.0]}),
    ):
        if sign in words:
            return json.dumps(answer)
    return json.dumps({"floor": 4, "object": "green flower pot"})


class Seen(NamedTuple):
    """One request as the server took it: which picture came after which words."""

    path: str
    body: dict[str, Any]
    words: str
    pictures: int


class Refusal(Exception):
    def __init__(self, status: int, body: object) -> None:
        super().__init__(str(body))
        self.status = status
        self.body = body


def openai_error(status: int, message: str, **more: object) -> Refusal:
    return Refusal(status, {"error": {"message": message, "type": "invalid_request_error", "code": None, **more}})


class QuirkyServer:
    """`kind` names a server preset. `loading` is how many requests find the model still loading."""

    def __init__(self, kind: str, brain: Brain = answers, *, loading: int = 0) -> None:
        self.kind = kind
        self.brain = brain
        self.loading = loading
        self.asked: list[Seen] = []
        self.port = 0
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._runner: web.AppRunner | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/v1"

    def start(self) -> Self:
        self._thread.start()
        asyncio.run_coroutine_threadsafe(self._serve(), self._loop).result(10)
        return self

    def stop(self) -> None:
        async def clean() -> None:
            assert self._runner is not None
            await self._runner.cleanup()

        asyncio.run_coroutine_threadsafe(clean(), self._loop).result(10)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)
        self._loop.close()

    async def _serve(self) -> None:
        app = web.Application(client_max_size=64 * 1024 * 1024)
        if self.kind == "ollama":
            app.router.add_post("/api/chat", self._chat)
        else:
            app.router.add_post("/v1/chat/completions", self._chat)
        self._runner = web.AppRunner(app, shutdown_timeout=0.2)
        await self._runner.setup()
        await web.TCPSite(self._runner, "127.0.0.1", 0).start()
        self.port = self._runner.addresses[0][1]

    async def _chat(self, request: web.Request) -> web.Response:
        body = json.loads(await request.read())
        try:
            if self.loading > 0:
                self.loading -= 1
                raise Refusal(503, {"error": {"code": 503, "message": "Loading model", "type": "unavailable_error"}})
            words, pictures = _ollama_content(body) if self.kind == "ollama" else _openai_content(body)
            _CHECKS.get(self.kind, _anything)(body, words)
            self.asked.append(Seen(request.path, body, words, pictures))
            said = self.brain(words)
        except Refusal as refusal:
            return web.json_response(refusal.body, status=refusal.status)
        return web.json_response(_ollama_reply(said) if self.kind == "ollama" else self._openai_reply(said))

    def _openai_reply(self, said: str) -> dict[str, Any]:
        message: dict[str, Any] = {"role": "assistant", "content": said}
        if self.kind in ("openrouter", "vllm"):
            message["reasoning"] = 'let me see, {"floors": 9}?'
        if self.kind in ("dashscope", "llama-cpp"):
            message["reasoning_content"] = 'let me see, {"floors": 9}?'
        choice = {"index": 0, "message": message, "finish_reason": "stop", "native_finish_reason": "STOP"}
        usage = {"prompt_tokens": 50, "completion_tokens": 5, "total_tokens": 55}
        return {"id": "x", "object": "chat.completion", "created": 1, "model": "m", "choices": [choice], "usage": usage}


def _openai_content(body: dict[str, Any]) -> tuple[str, int]:
    words: list[str] = []
    pictures = 0
    for message in body["messages"]:
        content: str | list[dict[str, Any]] = message["content"]
        parts: list[dict[str, Any]] = [{"type": "text", "text": content}] if isinstance(content, str) else content
        for part in parts:
            if part["type"] == "text":
                words.append(part["text"])
            elif part["image_url"]["url"].startswith("data:image/jpeg;base64,"):
                pictures += 1
            else:
                raise openai_error(400, "'url' field must be a base64 encoded image.")
    return "\n".join(words), pictures


def _ollama_content(body: dict[str, Any]) -> tuple[str, int]:
    if body.get("stream") is not False:
        raise Refusal(400, {"error": "this mock does not stream"})
    for message in body["messages"]:
        if not isinstance(message["content"], str):
            # what Ollama's JSON decoder says to OpenAI's lists of parts
            raise Refusal(400, {"error": "json: cannot unmarshal array into Go struct field .messages.content"})
        for picture in message.get("images", []):
            if picture.startswith("data:"):
                raise Refusal(400, {"error": "illegal base64 data at input byte 4"})
    words = "\n".join(message["content"] for message in body["messages"])
    return words, sum(len(message.get("images", [])) for message in body["messages"])


def _ollama_reply(said: str) -> dict[str, Any]:
    message = {"role": "assistant", "content": said, "thinking": 'let me see, {"floors": 9}?'}
    return {
        "model": "m",
        "created_at": "2026-01-01T00:00:00Z",
        "message": message,
        "done": True,
        "done_reason": "stop",
        "prompt_eval_count": 50,
        "eval_count": 5,
    }


def _anything(body: dict[str, Any], words: str) -> None:
    """A server that ignores what it does not know."""


def _check_openai(body: dict[str, Any], words: str) -> None:
    if "max_tokens" in body:
        raise openai_error(400, "Unsupported parameter: 'max_tokens'. Use 'max_completion_tokens' instead.")
    form = body["response_format"]["json_schema"]
    _check_strict(form["schema"])
    if form["strict"] is not True or not form["name"]:
        raise openai_error(400, "Invalid schema for response_format")


def _check_strict(schema: dict[str, Any]) -> None:
    """OpenAI's strict mode: every property required, none beyond them."""
    if schema.get("type") == "object" and (
        schema.get("additionalProperties") is not False or set(schema["required"]) != set(schema["properties"])
    ):
        raise openai_error(400, "Invalid schema for response_format: 'required' must include every key")
    items = [schema["items"]] if "items" in schema else []
    for one in (*schema.get("properties", {}).values(), *schema.get("anyOf", ()), *items):
        _check_strict(one)


def _check_lm_studio(body: dict[str, Any], words: str) -> None:
    if body.get("response_format", {"type": "text"})["type"] not in ("json_schema", "text"):
        raise Refusal(400, {"error": "'response_format.type' must be 'json_schema' or 'text'"})


def _check_llama_cpp_python(body: dict[str, Any], words: str) -> None:
    if body.get("response_format", {"type": "text"})["type"] not in ("text", "json_object"):
        where = 'File "/srv/models/llama_cpp/server/app.py", line 376, in create_chat_completion'
        said = f"1 validation error:\n  'loc': ('body', 'response_format', 'type')\n\n  {where}"
        raise Refusal(500, {"error": {"message": said, "type": "internal_server_error", "code": None}})


def _check_dashscope(body: dict[str, Any], words: str) -> None:
    kind = body.get("response_format", {}).get("type")
    if kind == "json_schema":
        raise openai_error(400, "'response_format' of type 'json_schema' is not supported by this model")
    if kind == "json_object" and "json" not in words.lower():
        message = (
            "'messages' must contain the word 'json' in some form, to use 'response_format' of type 'json_object'."
        )
        raise openai_error(400, message)


def _check_transformers(body: dict[str, Any], words: str) -> None:
    known = {"model", "messages", "temperature", "max_tokens", "response_format", "stream", "seed", "top_p", "stop"}
    if unexpected := set(body) - known:
        raise Refusal(422, {"detail": f"Unexpected fields in the request: {unexpected}"})


def _check_openrouter(body: dict[str, Any], words: str) -> None:
    if "response_format" in body and not body.get("provider", {}).get("require_parameters"):
        raise openai_error(400, "this mock's provider would silently drop response_format")


def _check_vllm(body: dict[str, Any], words: str) -> None:
    if "guided_json" in body:
        raise openai_error(400, "guided_json was removed, use structured_outputs", type="BadRequestError", code=400)


def _check_ollama(body: dict[str, Any], words: str) -> None:
    if "response_format" in body or "max_tokens" in body:
        raise Refusal(400, {"error": "OpenAI's fields mean nothing here"})
    if not isinstance(body.get("format", {}), dict):
        raise Refusal(400, {"error": "invalid format"})


def _check_grammar(body: dict[str, Any], words: str) -> None:
    if not body.get("grammar", "root ::=").startswith("root ::="):
        raise openai_error(400, "failed to parse grammar")


_CHECKS: dict[str, Callable[[dict[str, Any], str], None]] = {
    "openai": _check_openai,
    "lm-studio": _check_lm_studio,
    "llama-cpp-python": _check_llama_cpp_python,
    "dashscope": _check_dashscope,
    "transformers": _check_transformers,
    "openrouter": _check_openrouter,
    "vllm": _check_vllm,
    "ollama": _check_ollama,
    "llama-cpp-grammar": _check_grammar,
}


class RawServer:
    """Answers every connection with these bytes, whatever HTTP says, a piece at a time; then hangs up."""

    def __init__(self, pieces: list[bytes], pause_s: float = 0.0) -> None:
        self._pieces = pieces
        self._pause_s = pause_s
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._ended = threading.Event()
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}/v1"
        threading.Thread(target=self._accept, daemon=True).start()

    def stop(self) -> None:
        self._ended.set()
        self._listener.close()

    def _accept(self) -> None:
        while not self._ended.is_set():
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._answer, args=(connection,), daemon=True).start()

    def _answer(self, connection: socket.socket) -> None:
        with connection, contextlib.suppress(OSError):
            head = b""
            while b"\r\n\r\n" not in head:
                head += connection.recv(65536)
            body = head.partition(b"\r\n\r\n")[2]
            length = int(re.search(rb"content-length: (\d+)", head.lower()).group(1))  # type: ignore[union-attr]
            while len(body) < length:
                body += connection.recv(65536)
            for piece in self._pieces:
                connection.sendall(piece)
                if self._pause_s and self._ended.wait(self._pause_s):
                    return


@contextmanager
def raw(*pieces: bytes, pause_s: float = 0.0) -> Iterator[RawServer]:
    server = RawServer(list(pieces), pause_s)
    try:
        yield server
    finally:
        server.stop()


@contextmanager
def running(kind: str, brain: Brain = answers, *, loading: int = 0) -> Iterator[QuirkyServer]:
    server = QuirkyServer(kind, brain, loading=loading).start()
    try:
        yield server
    finally:
        server.stop()

"""The gateway in front of llama-cpp-python's server with a tiny random llama: held to a grammar, noise has the right
form; whether it makes sense is still checked here."""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.conftest import free_port
from tests.real_server.conftest import HERE, Gateway, Running, environment_of, process
from tests.services.vlm_gateway.kit import direction_body, find_body, floors_body

pytestmark = pytest.mark.real_server


@pytest.fixture(scope="module")
def llama(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("tiny-llama")
    python = str(environment_of("llama-server") / "python")
    model = folder / "tiny.gguf"
    subprocess.run([python, str(HERE / "tiny_text_model.py"), str(model)], check=True, timeout=300)
    port = free_port()
    command = [python, "-m", "llama_cpp.server", "--model", str(model), "--host", "127.0.0.1", "--port", str(port)]
    command += ["--n_ctx", "8192", "--chat_format", "chatml"]
    url = f"http://127.0.0.1:{port}/v1"
    with process(command, url + "/models", folder / "llama.log") as started:
        yield Running(url, str(model), started, folder / "llama.log")


def ask(llama: Running, gateway: Gateway, path: str, body: object, **settings: object) -> httpx.Response:
    values: dict[str, object] = {
        "backend": "chat",
        "preset": "gpt-4o",
        "server": "llama-cpp-grammar",
        "base_url": llama.url,
        "model": llama.model,
        "max_tokens": 200,
        "timeout_s": 120,
    }
    lines = [f"{name} = {json.dumps(value)}" for name, value in (values | settings).items()]
    url = gateway("[models.tiny]\n" + "\n".join(lines) + "\n")
    assert isinstance(body, dict)
    return httpx.post(f"{url}/v1/{path}", json={"model": "tiny", **body}, timeout=180)


@pytest.mark.parametrize(
    ("server", "structured"), [("llama-cpp-grammar", "grammar"), ("llama-cpp-python", "json_object_schema")]
)
def test_noise_that_is_held_to_a_form_chooses_one_of_the_offered_points(
    llama: Running, gateway: Gateway, server: str, structured: str
) -> None:
    told = ask(llama, gateway, "choose-direction", direction_body("ace"), server=server, structured=structured).json()
    assert (told["outcome"], told["attempts"]) == ("answered", 1)
    assert told["label"] in ("a", "c", "e")


def test_without_a_form_the_same_noise_is_unreadable(llama: Running, gateway: Gateway) -> None:
    told = ask(llama, gateway, "choose-direction", direction_body("ace"), structured="none").json()
    assert (told["outcome"], told["label"], told["attempts"]) == ("unreadable", None, 2)


def test_numbers_of_the_right_form_are_still_checked(llama: Running, gateway: Gateway) -> None:
    """The grammar lets three digits through, the schema's server as many as it likes; a building has a hundred floors
    at most."""
    for server in ("llama-cpp-grammar", "llama-cpp-python"):
        told = ask(llama, gateway, "floor-count", floors_body(), server=server).json()
        assert told["outcome"] in ("answered", "unreadable")
        count = json.loads(told["text"])["floors"]
        assert (told["outcome"] == "answered") == (count <= 100)
        assert told["floors"] == (count if count <= 100 else None)


def test_boxes_of_noise_end_in_a_typed_outcome(llama: Running, gateway: Gateway) -> None:
    for path, body, content in (("building-box", floors_body(), "box"), ("find-object", find_body((0, 45)), "found")):
        answer = ask(llama, gateway, path, body)
        told = answer.json()
        assert answer.status_code == 200
        assert told["outcome"] in ("answered", "unreadable")
        assert told["outcome"] == "answered" or told[content] is None


def test_a_dialect_it_does_not_know_is_found_out_and_left(llama: Running, gateway: Gateway, tmp_path: Path) -> None:
    told = ask(llama, gateway, "floor-count", floors_body(), server="llama-cpp").json()
    assert told["outcome"] == "unreadable"

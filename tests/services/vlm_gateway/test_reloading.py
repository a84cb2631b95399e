"""The configuration changes under a running gateway: as its own process, with a real signal and a real file."""

import hashlib
import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import pytest

from services.vlm_gateway.reloading import Reloader
from tests.load.processes import Running, service
from tests.services.vlm_gateway.kit import wait_until
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says, says_when, streams

PATH = "/v1/chat/completions"
OPERATOR = {"authorization": "Bearer sk-operator"}


class Subject(NamedTuple):
    """A gateway process and the file that it reads."""

    gateway: Running
    file: Path

    def says(self, mock: OpenAiMock, *keys: str, **model: Any) -> None:
        """The file says this now: one model, and these keys."""
        new = self.file.with_suffix(".new")
        new.write_text(configuration(mock, *keys, **model))
        os.replace(new, self.file)

    def configured(self) -> dict[str, Any]:
        told = httpx.get(self.gateway.url + "/v1/status", headers=OPERATOR, timeout=60).json()["configuration"]
        return dict(told)

    def reloaded_after(self, before: dict[str, Any]) -> None:
        wait_until(lambda: self.configured() != before)

    def ask(self, key: str, model: str = "m", **more: Any) -> httpx.Response:
        body = {"model": model, "messages": [{"role": "user", "content": "hi"}], **more}
        headers = {"authorization": f"Bearer sk-{key}"}
        return httpx.post(self.gateway.url + PATH, json=body, headers=headers, timeout=60)


def configuration(mock: OpenAiMock, *keys: str, alias: str = "m", **model: Any) -> str:
    table = {"backend": "chat", "preset": "gpt-4o", "base_url": mock.url, "model": "maker/model", **model}
    lines = [f"[models.{alias}]", *(f"{name} = {json.dumps(value)}" for name, value in table.items())]
    for key in keys:
        lines += [f"[keys.{key}]", f'sha256 = "{hashlib.sha256(f"sk-{key}".encode()).hexdigest()}"']
    return "\n".join(lines) + "\n"


@pytest.fixture
def subject(mock: OpenAiMock, tmp_path: Path) -> Iterator[Subject]:
    file = tmp_path / "gateway.toml"
    file.write_text(configuration(mock, "old"))
    environment = {
        "GATEWAY_CONFIG": str(file),
        "GATEWAY_TOKEN": "sk-operator",
        "CACHE_PATH": str(tmp_path / "answers.sqlite"),
    }
    with service("services.vlm_gateway", environment) as gateway:
        yield Subject(gateway, file)


def test_a_key_is_rotated_without_dropping_a_call(subject: Subject, mock: OpenAiMock) -> None:
    go = threading.Event()
    mock.will(says_when(go, "slow"))
    slow: list[int] = []
    caller = threading.Thread(target=lambda: slow.append(subject.ask("old").status_code))
    caller.start()
    wait_until(lambda: len(mock.asked) == 1)
    before = subject.configured()
    subject.says(mock, "new")
    os.kill(subject.gateway.process.pid, signal.SIGHUP)
    subject.reloaded_after(before)
    assert subject.ask("old").status_code == 401
    mock.will(says("hello"))
    assert subject.ask("new").status_code == 200
    go.set()
    caller.join(60)
    assert slow == [200]


def test_a_changed_file_is_read_by_itself_and_a_wrong_one_keeps_the_old(subject: Subject, mock: OpenAiMock) -> None:
    before = subject.configured()
    subject.file.write_text("[models.m]\nbackend = 'chat'\n")
    subject.reloaded_after(before)
    assert "models.m" in subject.configured()["problem"]
    assert subject.ask("old").status_code == 200
    broken = subject.configured()
    subject.says(mock, "old", alias="other")
    subject.reloaded_after(broken)
    assert subject.configured()["problem"] == ""
    assert subject.ask("old", model="other").status_code == 200
    assert subject.ask("old").status_code == 404


def test_a_file_is_not_read_while_it_is_being_written(tmp_path: Path) -> None:
    file = tmp_path / "gateway.toml"
    file.write_text("[keys.one]\n")
    reloader = Reloader(lambda: (), lambda: [file])
    assert not reloader.has_changed()
    file.write_text("[keys.one]\n[keys.tw")
    assert not reloader.has_changed()
    file.write_text("[keys.one]\n[keys.two]\n")
    assert not reloader.has_changed()
    assert reloader.has_changed()
    reloader.now()
    assert not reloader.has_changed()


def test_a_file_that_was_emptied_keeps_the_old_one(subject: Subject) -> None:
    before = subject.configured()
    subject.file.write_text("")
    subject.reloaded_after(before)
    assert "is empty" in subject.configured()["problem"]
    assert subject.ask("old").status_code == 200
    assert subject.ask("nobody").status_code == 401


def test_no_changed_file_opens_a_gateway_with_keys(mock: OpenAiMock, tmp_path: Path) -> None:
    file = tmp_path / "gateway.toml"
    file.write_text(configuration(mock, "old", "operator") + "admin = true\n")
    with service("services.vlm_gateway", {"GATEWAY_CONFIG": str(file), "CACHE_MODE": "off"}) as gateway:
        subject = Subject(gateway, file)
        before = subject.configured()
        subject.says(mock)
        os.kill(gateway.process.pid, signal.SIGHUP)
        subject.reloaded_after(before)
        assert "would let everybody in" in subject.configured()["problem"]
        assert subject.ask("nobody").status_code == 401
        assert subject.ask("old").status_code == 200


def test_a_stream_of_a_model_that_is_taken_out_goes_on_to_its_end(subject: Subject, mock: OpenAiMock) -> None:
    mock.will(streams("one", "two", "three", "four", pause_s=1.0))
    body = {"model": "m", "messages": [{"role": "user", "content": "hi"}], "stream": True}
    headers = {"authorization": "Bearer sk-old"}
    with httpx.stream("POST", subject.gateway.url + PATH, json=body, headers=headers, timeout=60) as answer:
        pieces = answer.iter_bytes()
        first = next(pieces)
        before = subject.configured()
        subject.says(mock, "old", concurrency=9)
        os.kill(subject.gateway.process.pid, signal.SIGHUP)
        subject.reloaded_after(before)
        whole = first + b"".join(pieces)
    assert b"four" in whole
    assert b"[DONE]" in whole
    time.sleep(1.5)
    assert httpx.get(subject.gateway.url + "/healthz", timeout=60).status_code == 200

"""What our connections use of uvicorn's private classes is there, in the version that is installed."""

import importlib.metadata
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from uvicorn.protocols.http import flow_control, httptools_impl
from uvicorn.server import ServerState

ROOT = Path(__file__).parent.parent.parent


def test_uvicorn_is_the_version_whose_private_classes_are_used() -> None:
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    pinned = next(line for line in wanted if line.startswith("uvicorn"))
    assert pinned == f"uvicorn[standard]=={importlib.metadata.version('uvicorn')}"


@pytest.mark.parametrize(
    ("owner", "names"),
    [
        (
            httptools_impl.HttpToolsProtocol,
            "connection_made connection_lost data_received pause_writing resume_writing on_message_begin on_url "
            "on_header on_headers_complete on_body on_message_complete on_response_complete shutdown "
            "_start_asgi_task",
        ),
        (flow_control.FlowControl, "drain pause_reading resume_reading pause_writing resume_writing"),
        (httptools_impl.RequestResponseCycle, "run_asgi send receive"),
    ],
)
def test_uvicorns_private_classes_have_what_is_used_of_them(owner: type, names: str) -> None:
    assert [name for name in names.split() if not callable(getattr(owner, name, None))] == []


def test_uvicorns_connections_carry_what_is_looked_at() -> None:
    used: dict[Callable[..., object], str] = {
        httptools_impl.HttpToolsProtocol.__init__: "parser loop flow transport pipeline cycle headers tasks "
        "server_state expect_100_continue",
        httptools_impl.RequestResponseCycle.__init__: "disconnected keep_alive response_started response_complete "
        "message_event",
        flow_control.FlowControl.__init__: "read_paused write_paused",
        ServerState.__init__: "default_headers total_requests",
    }
    for constructor, names in used.items():
        code = constructor.__code__
        missing = [name for name in names.split() if name not in code.co_names]
        assert missing == [], constructor.__qualname__

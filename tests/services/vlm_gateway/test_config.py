"""A wrong configuration refuses to start and says where and what would be right; secrets stay out of messages."""

import os
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

from service_kit.settings import BadSetting
from services.vlm_gateway.bootstrap import build
from services.vlm_gateway.config import ChatLimits, KeyConfig, chat_model, load_config
from services.vlm_gateway.model_configs import ChatModelConfig
from services.vlm_gateway.presets import families, servers
from services.vlm_gateway.settings import GatewaySettings

GOOD = """
[models.qwen]
backend = "chat"
preset = "qwen2.5-vl"
server = "vllm"
model = "Qwen/Qwen2.5-VL-7B-Instruct"

[roles]
floors = "qwen"
parser = "qwen"
"""
CHAT = '[models.m]\nbackend = "chat"\nmodel = "x"\npreset = "gpt-4o"\n'


def started(environment: dict[str, str]) -> None:
    """As the process does it. Raises BadSetting."""
    build(GatewaySettings.read(environment), environment=environment)


def write(folder: Path, text: str) -> Path:
    path = folder / "gateway.toml"
    path.write_text(text)
    return path


def test_without_a_file_the_embedded_model_plays_every_vision_role_and_there_is_no_oracle() -> None:
    config = load_config(None, oracle_allowed=False)
    assert set(config.models) == {"embedded"}
    assert config.roles == {"floors": "embedded", "recognition": "embedded", "choice": "embedded"}


def test_the_oracle_is_there_once_switched_on() -> None:
    assert set(load_config(None, oracle_allowed=True).models) == {"embedded", "oracle"}


def test_a_file_adds_models_and_moves_roles(tmp_path: Path) -> None:
    config = load_config(write(tmp_path, GOOD), oracle_allowed=False)
    assert set(config.models) == {"embedded", "qwen"}
    assert config.roles == {"floors": "qwen", "recognition": "embedded", "choice": "embedded", "parser": "qwen"}


def test_what_a_model_does_not_say_comes_from_its_preset_and_server() -> None:
    values = {"backend": "chat", "model": "x", "preset": "deepseek-r1-distill", "server": "ollama"}
    model = chat_model("m", ChatModelConfig.model_validate(values), "f")
    assert (model.base_url, model.structured, model.temperature) == ("http://127.0.0.1:11434/v1", "format", 0.6)
    own = ChatModelConfig.model_validate(values | {"temperature": 0.0, "structured": "none", "max_tokens": 99})
    model = chat_model("m", own, "f")
    assert (model.structured, model.temperature, model.max_tokens) == ("none", 0.0, 99)


WRONG = [
    ("no TOML", "[models", ["not valid TOML", "at end of document"]),
    ("unknown table", "[model.x]", ["model: no such key", "models, roles"]),
    ("unknown back end", '[models.m]\nbackend = "magic"', ["models.m", "embedded, scripted, oracle, chat"]),
    ("unknown role", '[roles]\nrecognise = "embedded"', ["roles.recognise: no such role", "'recognition'?"]),
    ("no back end", '[models.m]\nmodel = "x"', ["models.m", "backend must be one of"]),
    (
        "unknown back end with the keys of a chat model",
        '[models.m]\nbackend = "qwen"\nbase_url = "http://x/v1"',
        ["models.m.backend", "embedded, scripted, oracle, chat", "'qwen'"],
    ),
    (
        "unknown budget",
        f'[keys.k]\nsha256 = "{"0" * 64}"\nspeed = 3',
        ["keys.k.speed", "no such key", "tokens_per_day"],
    ),
    ("unknown key", CHAT + "concurency = 3", ["models.m.concurency", "no such key", "concurrency"]),
    ("wrong type", CHAT + 'timeout_s = "long"', ["models.m.timeout_s", "number"]),
    ("out of bounds", CHAT + "concurrency = 0", ["models.m.concurrency", "greater than or equal to 1"]),
    ("unknown preset", CHAT.replace("gpt-4o", "gpt-9"), ["models.m.preset", "'gpt-9'", "qwen2.5-vl"]),
    ("unknown server", CHAT + 'server = "vlm"', ["models.m.server", "'vlm'", "vllm"]),
    ("no address", CHAT, ["models.m.base_url", "http://127.0.0.1:8000/v1"]),
    ("credentials in it", CHAT + 'base_url = "http://me:pw@host/v1"', ["leave credentials out", "api_key_env"]),
    ("not http", CHAT + 'base_url = "file:///etc/passwd"', ["models.m.base_url"]),
    ("two keys", CHAT + 'server="vllm"\napi_key_env = "A"\napi_key_file = "b"', ["not both"]),
    ("a field of ours", CHAT + 'server="vllm"\nextra = {stream = true}', ["models.m.extra", "stream"]),
    ("pixels the wrong way", CHAT + 'server="vllm"\nmin_pixels = 9\nmax_pixels = 4', ["min_pixels 9"]),
    ("unknown role", '[roles]\npilot = "embedded"', ["roles.pilot", "parser, floors, recognition, choice"]),
    ("unknown alias", '[roles]\nfloors = "qwen"', ["roles.floors", "'qwen'", "embedded"]),
    ("a parser that can't talk", '[roles]\nparser = "embedded"', ["roles.parser", "chat"]),
    ("oracle not switched on", '[models.truth]\nbackend = "oracle"', ["models.truth", "ORACLE_SIM_URL"]),
]


@pytest.mark.parametrize(("text", "parts"), [w[1:] for w in WRONG], ids=[w[0] for w in WRONG])
def test_a_wrong_file_names_itself_the_key_and_what_is_right(tmp_path: Path, text: str, parts: list[str]) -> None:
    path = write(tmp_path, text)
    with pytest.raises(BadSetting) as raised:
        load_config(path, oracle_allowed=False)
    for part in [str(path), *parts]:
        assert part in str(raised.value)


def test_a_missing_key_stops_the_start(tmp_path: Path) -> None:
    path = write(tmp_path, CHAT + 'server = "vllm"\napi_key_env = "MY_KEY"')
    environment = {"GATEWAY_CONFIG": str(path), "CACHE_MODE": "off"}
    with pytest.raises(BadSetting, match=r"models\.m\.api_key_env: MY_KEY is not set"):
        started(environment)
    with pytest.raises(BadSetting, match="MY_KEY holds more than a key") as raised:
        started(environment | {"MY_KEY": "sk-1\nX-Evil: 1"})
    assert "sk-1" not in str(raised.value)
    path = write(tmp_path, CHAT + 'server = "vllm"\napi_key_file = "/no/such/file"')
    with pytest.raises(BadSetting, match=r"models\.m\.api_key_file: No such file"):
        started(environment)


@pytest.mark.parametrize(
    ("environment", "message"),
    [
        ({"CACHE_MODE": "maybe"}, "CACHE_MODE=maybe: choose one of on, off, replay"),
        ({"CACHE_PATH": "/proc/answers.sqlite"}, "CACHE_PATH=/proc/answers.sqlite"),
        ({"REDIS_URL": "http://:secret@host"}, "give redis://"),
        ({"CACHE_TTL_S": "-1"}, "CACHE_TTL_S=-1"),
        ({"GATEWAY_CONFIG": "/no/such.toml"}, "GATEWAY_CONFIG=/no/such.toml"),
    ],
)
def test_wrong_settings_stop_the_start(environment: dict[str, str], message: str) -> None:
    with pytest.raises(BadSetting) as raised:
        started(environment)
    assert message in str(raised.value)
    assert "secret" not in str(raised.value)


def test_the_process_says_why_it_does_not_start_in_one_line(tmp_path: Path) -> None:
    path = write(tmp_path, '[roles]\nfloors = "qwen"')
    environment = {**os.environ, "GATEWAY_CONFIG": str(path), "CACHE_MODE": "off"}
    command = [sys.executable, "-m", "services.vlm_gateway"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "roles.floors: no model 'qwen'" in done.stderr


def test_the_example_that_ships_is_right() -> None:
    config = load_config(Path(str(files("services.vlm_gateway.presets") / "example.toml")), oracle_allowed=False)
    assert config.roles["parser"] == "deepseek-r1"
    assert len(config.models) == 6


def test_the_example_of_the_documentation_is_right(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "gateway.md").read_text(encoding="utf-8")
    example = page.split("```toml\n")[1].split("```")[0]
    config = load_config(write(tmp_path, example), oracle_allowed=False)
    assert config.roles["recognition"] == "qwen"
    assert set(config.models) == {"embedded", "qwen", "gemini", "llama"}
    assert set(config.keys) == {"team-a"}


def test_the_documentation_lists_every_preset_and_every_key() -> None:
    page = (Path(__file__).parents[3] / "docs" / "gateway.md").read_text(encoding="utf-8")
    tables = (ChatModelConfig, KeyConfig, ChatLimits)
    keys = [field.alias or name for table in tables for name, field in table.model_fields.items()]
    for name in (*servers(), *families(), *keys):
        assert f"`{name}`" in page or f"{name} =" in page, name

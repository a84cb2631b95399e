"""One table of all settings: documented as it is, read in one place, and used as it says."""

import ast
from pathlib import Path

import pytest
import yaml

from launcher.processes import STARTED_WITH
from scripts.configuration import OTHER_VEHICLES, SERVICES, page
from service_kit.connections import TOKEN_VARIABLES, Connections
from service_kit.settings import Variable
from services.vlm_gateway.settings import CacheSettings
from tests.sources import tree_of_source

ROOT = Path(__file__).parent.parent
OURS = (
    "contracts",
    "navigation",
    "service_kit",
    "episode_kit",
    "services",
    "mission",
    "orchestrator",
    "launcher",
    "evaluation",
)
COMMANDS = ("command_line", "training", "scripts")
ENVIRONMENT_IS_READ_BY = Path("service_kit/settings.py")
KEYS_OF_MODELS = ("OPENAI_API_KEY", "GEMINI_API_KEY", "DASHSCOPE_API_KEY", "OPENROUTER_API_KEY")
"""Named by the gateway's TOML file, as `api_key_env`; no settings of ours."""
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))["services"]
ALL = SERVICES | OTHER_VEHICLES
MODULES = sorted(p for package in (*OURS, *COMMANDS) for p in (ROOT / package).rglob("*.py"))


def test_the_documentation_is_what_the_classes_say() -> None:
    written = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
    assert written == page(), "run `make configuration`"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_one_module_alone_reads_the_environment(path: Path) -> None:
    tree = tree_of_source(path.read_text(encoding="utf-8"))
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "os"}
    used |= {a.name for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module == "os" for a in n.names}
    reads = used & {"environ", "environb", "getenv", "getenvb", "putenv"}
    assert not reads or path.relative_to(ROOT) == ENVIRONMENT_IS_READ_BY, "take the environment as a parameter"


def test_every_setting_says_what_it_means() -> None:
    for name, kind in ALL.items():
        assert all(variable.meaning.endswith(".") for variable in kind.variables()), name


def test_a_variable_means_the_same_wherever_it_is_read() -> None:
    readers = (*ALL.values(), Connections, CacheSettings)
    seen: dict[str, Variable] = {}
    for variable in (v for kind in readers for v in kind.variables()):
        first = seen.setdefault(variable.name, variable)
        assert (variable.kind, variable.secret) == (first.kind, first.secret), variable.name


def test_every_service_and_its_callers_share_one_token_variable() -> None:
    for name, kind in SERVICES.items():
        assert TOKEN_VARIABLES[name] in kind.names()
        assert name == "orchestrator" or TOKEN_VARIABLES[name] in Connections.names()


@pytest.mark.parametrize("name", SERVICES)
def test_compose_sets_only_variables_that_the_service_reads(name: str) -> None:
    service = COMPOSE[name.replace("_", "-")]
    keys = {variable for key in KEYS_OF_MODELS for variable in (key, f"{key}_FILE")}
    of_the_c_library = STARTED_WITH.get(name, {})
    assert of_the_c_library.items() <= service["environment"].items()
    assert set(service["environment"]) - keys - set(of_the_c_library) <= SERVICES[name].names()


@pytest.mark.parametrize("name", SERVICES)
def test_compose_hands_every_token_on_from_variable_and_file(name: str) -> None:
    service = COMPOSE[name.replace("_", "-")]
    keys = KEYS_OF_MODELS if name == "vlm_gateway" else ()
    wanted = [v.name for v in SERVICES[name].variables() if v.secret and not v.name.endswith("REDIS_URL")]
    for variable in (*wanted, *keys):
        assert service["environment"][variable] == f"${{{variable}:-}}"
        assert service["environment"][f"{variable}_FILE"] == f"${{{variable}_FILE:+/run/secrets/{variable.lower()}}}"
    assert set(service["secrets"]) == {variable.lower() for variable in (*wanted, *keys)}


def test_what_is_set_in_one_environment_for_all_services_is_unknown_to_none() -> None:
    everything = dict.fromkeys(frozenset().union(*(kind.names() for kind in ALL.values())), "x")
    for kind in ALL.values():
        assert kind.unknown(everything, Connections.names()) == []

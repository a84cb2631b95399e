"""The rules that would drift if nobody checked them."""

import ast
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

import contracts.depth_assist
from contracts.base import Wire
from contracts.depth_assist import ApproachSettings, ExploreSettings, SafeDistanceSettings, ViewpointSettings
from contracts.orchestrator import MissionSettings
from navigation.approach import ApproachParameters
from navigation.explorer.parameters import ExplorerParameters
from navigation.floor_localization import FloorLocalizationParameters
from navigation.safe_distance import SafeDistanceParameters
from navigation.viewpoint import ViewpointParameters
from tests.sources import tree_of_source

ROOT = Path(__file__).parent.parent
ALLOWED: dict[str, set[str]] = {
    "contracts": set(),
    "navigation": set(),
    "service_kit": {"contracts"},
    "episode_kit": {"contracts", "service_kit"},
    "services": {"contracts", "navigation", "service_kit", "episode_kit"},
    "mission": {"contracts", "navigation", "service_kit"},
    "orchestrator": {"contracts", "service_kit", "mission"},
    "launcher": {"contracts", "service_kit"},
    "evaluation": {"contracts", "navigation", "service_kit", "mission", "launcher"},
    # what people import: it shows what the others have and has little of its own
    "logisticsvln": {"contracts", "navigation", "service_kit", "mission", "orchestrator", "launcher", "evaluation"},
    "command_line": {
        "contracts",
        "navigation",
        "service_kit",
        "mission",
        "orchestrator",
        "launcher",
        "evaluation",
        "logisticsvln",
    },
    # draws its streets in process and cuts crops as the gateway does; nothing imports it
    "training": {
        "contracts",
        "navigation",
        "evaluation",
        "services.sim",
        "services.llm_parser",
        "services.vlm_gateway",
    },
}
OURS = tuple(ALLOWED)
MAX_LINES = 300
TRANSLATED: dict[type[Wire], type[tuple[object, ...]]] = {
    ViewpointSettings: ViewpointParameters,
    SafeDistanceSettings: SafeDistanceParameters,
    ApproachSettings: ApproachParameters,
    ExploreSettings: ExplorerParameters,
    MissionSettings: FloorLocalizationParameters,
}
"""The contracts' settings, and the parameters of `navigation` they are translated to."""
RENAMED = {"band_reading": "reading"}
"""What a setting is called in `navigation`, where it has another name there."""


def modules(*packages: str) -> list[Path]:
    return sorted(p for package in packages for p in (ROOT / package).rglob("*.py"))


def imported_names(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield node.module or ""
            # `from package import module` reads the module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def dotted(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room(name: str) -> str:
    """The part of the house a module belongs to: a service counts as a room of its own."""
    parts = name.split(".")
    return ".".join(parts[:2]) if parts[0] == "services" else parts[0]


def package(name: str) -> str:
    """The folder in which the module of that dotted name lies; of a package, the package itself."""
    return name if (ROOT / name.replace(".", "/")).is_dir() else name.rpartition(".")[0]


def is_ours(name: str) -> bool:
    place = ROOT / name.replace(".", "/")
    return name.split(".")[0] in OURS and (place.is_dir() or place.with_suffix(".py").is_file())


def tree_of(path: Path) -> ast.Module:
    return tree_of_source(path.read_text(encoding="utf-8"), str(path))


def reached(graph: Mapping[str, set[str]], start: str) -> set[str]:
    """Whatever can be come to from `start` over one import or more."""
    found: set[str] = set()
    pending = list(graph.get(start, ()))
    while pending:
        node = pending.pop()
        if node not in found:
            found.add(node)
            pending += graph.get(node, ())
    return found


def cycles(graph: Mapping[str, set[str]]) -> set[frozenset[str]]:
    """The groups of nodes that come back to themselves."""
    beyond = {node: reached(graph, node) for node in graph}
    return {
        frozenset(other for other in beyond[node] if node in beyond.get(other, ()))
        for node in graph
        if node in beyond[node]
    }


def _nested(one: str, other: str) -> bool:
    return f"{one}.".startswith(f"{other}.") or f"{other}.".startswith(f"{one}.")


@pytest.mark.parametrize("path", modules(*OURS), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_follow_the_arrows_of_the_house(path: Path) -> None:
    here = room(dotted(path))
    allowed = ALLOWED[here.split(".")[0]]
    for name in imported_names(tree_of(path)):
        there = room(name)
        if there.split(".")[0] not in OURS or there == here:
            continue
        assert there in allowed, f"{path.relative_to(ROOT)} imports {name}: {here} may import only {sorted(allowed)}"


def test_nobody_imports_the_command_line() -> None:
    readers = {
        dotted(path)
        for path in modules(*OURS)
        if not dotted(path).startswith("command_line")
        and any(room(name) == "command_line" for name in imported_names(tree_of(path)))
    }
    assert not readers


def test_only_the_command_line_imports_what_people_import() -> None:
    readers = {
        room(dotted(path))
        for path in modules(*OURS)
        if any(room(name) == "logisticsvln" for name in imported_names(tree_of(path)))
    }
    assert readers == {"logisticsvln", "command_line"}


def test_every_package_that_is_installed_ships_its_types() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    installed = project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert set(installed) == set(OURS) - {"training"}
    assert [name for name in installed if not (ROOT / name / "py.typed").is_file()] == []


def test_packages_do_not_import_each_other_in_a_circle() -> None:
    graph: defaultdict[str, set[str]] = defaultdict(set)
    for path in modules(*OURS):
        here = package(dotted(path))
        there = {package(name) for name in imported_names(tree_of(path)) if is_ours(name)}
        # a package and the folders inside it are one house: `errors.py` beside `chat/` is everybody's
        graph[here] |= {other for other in there if not _nested(here, other)}
    assert not [sorted(circle) for circle in cycles(graph)]


def test_a_circle_is_found_where_there_is_one() -> None:
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == {frozenset({"b", "c"})}
    assert cycles({"a": {"b"}, "b": {"c"}, "c": set()}) == set()


@pytest.mark.parametrize("path", modules(*set(OURS) - {"command_line", "training"}), ids=str)
def test_libraries_neither_print_nor_exit(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    if path.name == "__main__.py" or '__name__ == "__main__"' in source:
        return  # a command may
    calls = {ast.unparse(node.func) for node in ast.walk(tree_of_source(source)) if isinstance(node, ast.Call)}
    assert not calls & {"print", "exit", "quit", "sys.exit", "os._exit"}


@pytest.mark.parametrize("path", modules(*OURS), ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_stay_short(path: Path) -> None:
    name = path.relative_to(ROOT).as_posix()
    if name.startswith("services/sim/catalogue/"):
        return
    lines = len(path.read_text(encoding="utf-8").splitlines())
    assert lines <= MAX_LINES, f"{name} has {lines} lines, {MAX_LINES} are enough"


@pytest.mark.parametrize("path", modules(*OURS), ids=lambda p: str(p.relative_to(ROOT)))
def test_every_module_says_what_it_is(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    assert not source.strip() or ast.get_docstring(tree_of(path)), "a module starts with its docstring"


def test_what_importing_a_contract_loads_is_light() -> None:
    heavy = {"pybullet", "moderngl", "fastapi", "aiohttp", "redis"}
    code = "import sys, contracts.sim, contracts.orchestrator; print(*sorted(m for m in sys.modules if '.' not in m))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not heavy & set(loaded)


def defaults_of(parameters: type[tuple[object, ...]]) -> set[str]:
    """The fields of a NamedTuple that have a default."""
    return set(getattr(parameters, "_field_defaults"))  # noqa: B009 - `type[tuple]` does not know the attribute


def stated_twice(settings: type[Wire], parameters: type[tuple[object, ...]]) -> set[str]:
    """The parameters that have a default although the settings they are translated from have that field."""
    return {RENAMED.get(name, name) for name in settings.model_fields} & defaults_of(parameters)


@pytest.mark.parametrize("settings", TRANSLATED, ids=lambda s: s.__name__)
def test_a_default_that_the_contracts_have_does_not_stand_in_navigation_too(settings: type[Wire]) -> None:
    twice = stated_twice(settings, TRANSLATED[settings])
    assert not twice, f"{TRANSLATED[settings].__name__}: the default stands in contracts.{settings.__name__}"


def test_a_default_that_stands_twice_is_found() -> None:
    class Twice(NamedTuple):
        l_max_m: float = 10.0
        reading: str = "upper_edge"
        unseen_m: float = 1.5

    assert stated_twice(SafeDistanceSettings, Twice) == {"l_max_m"}
    assert stated_twice(MissionSettings, Twice) == {"reading"}


def test_every_settings_type_of_depth_assist_is_translated() -> None:
    there = {value for name, value in vars(contracts.depth_assist).items() if name.endswith("Settings")}
    assert there == set(TRANSLATED) - {MissionSettings}

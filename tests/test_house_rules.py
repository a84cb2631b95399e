"""The rules that would drift if nobody checked them."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OURS = ("contracts", "navigation", "service_kit", "services", "mission", "orchestrator", "training", "vld")
ALLOWED = {
    "contracts": set(),
    "navigation": set(),
    "service_kit": {"contracts"},
    "services": {"contracts", "navigation", "service_kit"},
    "mission": {"contracts", "navigation", "service_kit"},
    "orchestrator": {"contracts", "navigation", "service_kit", "mission"},
    "vld": {"contracts", "navigation", "service_kit", "mission", "orchestrator"},
    # draws its streets in process and cuts crops as the gateway does; nothing imports it
    "training": {"contracts", "navigation", "vld", "services.sim", "services.vlm_gateway"},
}
MAX_LINES = 400


def modules(*packages: str) -> list[Path]:
    return sorted(p for package in packages for p in (ROOT / package).rglob("*.py"))


def imported_names(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield node.module or ""


def room(name: str) -> str:
    """The part of the house a module belongs to: a service counts as a room of its own."""
    parts = name.split(".")
    return ".".join(parts[:2]) if parts[0] == "services" else parts[0]


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


@pytest.mark.parametrize("path", modules(*OURS), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_follow_the_arrows_of_the_house(path: Path) -> None:
    here = room(".".join(path.relative_to(ROOT).with_suffix("").parts))
    allowed = ALLOWED[here.split(".")[0]]
    for name in imported_names(tree_of(path)):
        there = room(name)
        if there.split(".")[0] not in OURS or there == here:
            continue
        assert there in allowed, f"{path.relative_to(ROOT)} imports {name}: {here} may import only {sorted(allowed)}"


@pytest.mark.parametrize("path", modules("contracts", "navigation", "service_kit", "services"), ids=str)
def test_libraries_neither_print_nor_exit(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    if path.name == "__main__.py" or '__name__ == "__main__"' in source:
        return  # a command may
    calls = {ast.unparse(node.func) for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)}
    assert not calls & {"print", "exit", "quit", "sys.exit", "os._exit"}


@pytest.mark.parametrize("path", modules(*OURS), ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_stay_short_enough_to_know_their_room(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MAX_LINES


@pytest.mark.parametrize("path", modules(*OURS), ids=lambda p: str(p.relative_to(ROOT)))
def test_every_module_says_what_it_is(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    assert not source.strip() or ast.get_docstring(tree_of(path)), "a module starts with its docstring"


def test_what_importing_a_contract_loads_is_light() -> None:
    heavy = {"pybullet", "moderngl", "fastapi", "aiohttp", "redis"}
    code = "import sys, contracts.sim, contracts.orchestrator; print(*sorted(m for m in sys.modules if '.' not in m))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not heavy & set(loaded)

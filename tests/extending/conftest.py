"""The package of docs/extension-example, installed beside the tree as pip would install it."""

import shutil
import tomllib
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "docs" / "extension-example"


def install(source: Path, target: Path) -> Path:
    """Puts a package and its `.dist-info`, entry points included, into a folder for PYTHONPATH. Building a wheel would
    need a build back end from the network; what importlib.metadata reads is the same."""
    project = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    module = project["name"].replace("-", "_")
    shutil.copytree(source / module, target / module)
    info = target / f"{module}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    points = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in named.items())
        for group, named in project["entry-points"].items()
    ]
    (info / "entry_points.txt").write_text("\n".join(points))
    return target


@pytest.fixture(scope="session")
def extras(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that holds the example package."""
    return install(EXAMPLE, tmp_path_factory.mktemp("site"))

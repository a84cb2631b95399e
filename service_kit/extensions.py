"""What other installed packages bring to a service or a command: found by entry points, imported when it is used.

A package says in its pyproject.toml what it brings, and under which name:

```toml
[project.entry-points."logisticsvln.vision_backends"]
colour = "my_package.colour:build"
```
"""

import re
from collections.abc import Collection
from importlib.metadata import EntryPoint, entry_points

from service_kit.settings import BadSetting

VISION_BACKENDS = "logisticsvln.vision_backends"
SEARCH_POLICIES = "logisticsvln.search_policies"
TYPED_QUESTIONS = "logisticsvln.typed_questions"
METRICS = "logisticsvln.metrics"
CATALOGUE = "logisticsvln.catalogue"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.:-]{0,79}")


class BadExtension(BadSetting):
    """An extension that can't be used; the message names its package and says what is wrong."""


def extensions(group: str, *, reserved: Collection[str] = ()) -> dict[str, EntryPoint]:
    """The entry points of a group by name, nothing imported. Raises BadExtension for a name that is none, that two
    packages bring, or that is `reserved` for what we bring ourselves."""
    found: dict[str, EntryPoint] = {}
    for point in entry_points(group=group):
        if not _NAME.fullmatch(point.name):
            raise BadExtension(f"{_whose(point)} brings {point.name!r}: names hold letters, digits and _ . : - only")
        if point.name in reserved:
            raise BadExtension(f"{_whose(point)} brings {point.name!r}, which is built in; it needs another name")
        other = found.setdefault(point.name, point)
        if other.value != point.value:
            raise BadExtension(f"{_whose(other)} and {_whose(point)} both bring {point.name!r}: take one of them out")
    return dict(sorted(found.items()))


def loaded(point: EntryPoint) -> object:
    """What the entry point names, imported. Raises BadExtension whatever goes wrong in it."""
    try:
        return point.load()
    except Exception as error:  # an extension's import may fail in any way, and the service is not to fail with it
        why = f"{type(error).__name__}: {error}"
        raise BadExtension(
            f"{_whose(point)} brings {point.name!r}, but {point.value} can't be imported: {why}"
        ) from error


def _whose(point: EntryPoint) -> str:
    return f"package {point.dist.name!r} ({point.group})" if point.dist is not None else f"a package ({point.group})"

"""Search policies by name: those of the project, and those that installed packages bring by entry point."""

from collections.abc import Mapping
from functools import cache
from importlib.metadata import entry_points

from pydantic import ValidationError

from contracts.orchestrator import MissionSettings, SearchSettings
from mission.policies.base import AnyPolicy, SearchPolicy
from mission.policies.contour import ContourPolicy
from mission.policies.points import DefaultPolicy, PaperPolicy, RandomPolicy

GROUP = "logisticsvln.search_policies"
DEFAULT = ContourPolicy.name
OWN: tuple[type[AnyPolicy], ...] = (PaperPolicy, RandomPolicy, DefaultPolicy, ContourPolicy)


class BadSearch(ValueError):
    """No policy of that name, or settings that it has not got; the message says what there is."""


@cache
def policies() -> Mapping[str, type[AnyPolicy]]:
    """All policies by name, the project's own first. A package can't replace one of these. Raises BadSearch where an
    entry point does not lead to a policy."""
    found: dict[str, type[AnyPolicy]] = {policy.name: policy for policy in OWN}
    for entry in sorted(entry_points(group=GROUP), key=lambda e: e.name):
        try:
            policy = entry.load()
        except Exception as error:
            raise BadSearch(f"the search policy {entry.name} ({entry.value}) can't be loaded: {error}") from error
        if not isinstance(policy, type) or not issubclass(policy, SearchPolicy):
            raise BadSearch(f"the entry point {entry.name} ({entry.value}) is no SearchPolicy")
        if policy.name != entry.name:
            raise BadSearch(f"the entry point {entry.name} leads to a search policy that calls itself {policy.name}")
        found.setdefault(policy.name, policy)
    return found


def policy_names() -> tuple[str, ...]:
    """Names of all policies; none of the packages is loaded for it."""
    return tuple(dict.fromkeys([*(p.name for p in OWN), *sorted(e.name for e in entry_points(group=GROUP))]))


def words_of(search: SearchSettings) -> list[str]:
    """A recorded search for people: its policy's label and what is not as usual; the bare name where the policy is not
    installed here."""
    try:
        return policy_of(search).words()
    except BadSearch:
        return [search.policy or DEFAULT]


def policy_type(name: str | None) -> type[AnyPolicy]:
    """The policy of that name; the default one without. Raises BadSearch."""
    known = policies()
    if (name or DEFAULT) not in known:
        raise BadSearch(f"viewpoint: there is no search policy {name}; there are {', '.join(known)}")
    return known[name or DEFAULT]


def policy_of(search: SearchSettings) -> AnyPolicy:
    """The policy that the settings name, with its settings. Raises BadSearch."""
    kind = policy_type(search.policy)
    try:
        return kind(kind.settings_type.model_validate(search.constants, strict=False))
    except ValidationError as error:
        raise BadSearch(_said(kind, search, error)) from None


def completed(settings: MissionSettings) -> MissionSettings:
    """The same settings with the search policy named and every constant of it written out, as results are recorded.
    Raises BadSearch."""
    policy = policy_of(settings.viewpoint)
    search = SearchSettings(policy=policy.name, **policy.settings.model_dump(mode="json"))
    return settings.model_copy(update={"viewpoint": search})


def _said(kind: type[AnyPolicy], search: SearchSettings, error: ValidationError) -> str:
    """The first thing wrong, and what would be right."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] != "extra_forbidden":
        return f"viewpoint.{where}: {first['msg']}"
    said = f"viewpoint: the search policy {kind.name} has no setting {where}"
    others = [p.name for p in policies().values() if where in p.settings_type.model_fields]
    if others:
        hint = ": name the policy as well" if search.policy is None else ""
        return f"{said}; {', '.join(others)} {'have' if len(others) > 1 else 'has'} it{hint}"
    return f"{said}; it has {', '.join(kind.settings_type.model_fields)}"

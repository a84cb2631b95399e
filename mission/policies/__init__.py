"""Search policies by name: those of the project, and those that installed packages bring by entry point."""

from pydantic import ValidationError

from contracts.errors import what_is_wrong
from contracts.orchestrator import MissionSettings, SearchSettings
from mission.policies.base import AnyPolicy, SearchPolicy
from mission.policies.contour import ContourPolicy
from mission.policies.points import DefaultPolicy, PaperPolicy, RandomPolicy
from service_kit.extensions import SEARCH_POLICIES, BadExtension, extensions, loaded

DEFAULT = ContourPolicy.name
OWN: tuple[type[AnyPolicy], ...] = (PaperPolicy, RandomPolicy, DefaultPolicy, ContourPolicy)


class BadSearch(ValueError):
    """No policy of that name, or settings that it has not got; the message says what there is."""


def policy_names() -> tuple[str, ...]:
    """Names of all policies, the project's own first; no package is imported for it. Raises BadExtension for names that
    clash."""
    own = [policy.name for policy in OWN]
    return (*own, *extensions(SEARCH_POLICIES, reserved=own))


def label_of(name: str) -> str:
    """What people read for a policy; the bare name where it is not installed here."""
    try:
        return policy_type(name).label
    except (BadSearch, BadExtension):
        return name


def policy_type(name: str | None) -> type[AnyPolicy]:
    """The policy of that name; the default one without. Raises BadSearch, BadExtension."""
    name = name or DEFAULT
    own = {policy.name: policy for policy in OWN}
    if name in own:
        return own[name]
    brought = extensions(SEARCH_POLICIES, reserved=own)
    if name not in brought:
        raise BadSearch(f"viewpoint: there is no search policy {name}; there are {', '.join([*own, *brought])}")
    policy = loaded(brought[name])
    if not isinstance(policy, type) or not issubclass(policy, SearchPolicy):
        raise BadExtension(f"{brought[name].value}, the search policy {name}, is no class derived from SearchPolicy")
    if policy.name != name:
        raise BadExtension(f"{brought[name].value} is the search policy {policy.name}, but is brought as {name}")
    return policy


def words_of(search: SearchSettings) -> list[str]:
    """A recorded search for people: its policy's label and what is not as usual; the bare name where the policy is not
    installed here."""
    try:
        return policy_of(search).words()
    except (BadSearch, BadExtension):
        return [search.policy or DEFAULT]


def policy_of(search: SearchSettings) -> AnyPolicy:
    """The policy that the settings name, with its settings. Raises BadSearch, BadExtension."""
    kind = policy_type(search.policy)
    try:
        return kind(kind.settings_type.model_validate(search.constants, strict=False))
    except ValidationError as error:
        raise BadSearch(_said(kind, search, error)) from None


def completed(settings: MissionSettings, policy: AnyPolicy | None = None) -> MissionSettings:
    """The same settings with the search policy named and every constant of it written out, as results are recorded.
    `policy`: one that is at hand, instead of the one that the settings name. Raises BadSearch, BadExtension."""
    policy = policy or policy_of(settings.viewpoint)
    search = SearchSettings(policy=policy.name, **policy.settings.model_dump(mode="json"))
    return settings.model_copy(update={"viewpoint": search})


def _said(kind: type[AnyPolicy], search: SearchSettings, error: ValidationError) -> str:
    """The first thing wrong, and what would be right."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] != "extra_forbidden":
        return f"viewpoint.{where}: {what_is_wrong(first)}"
    said = f"viewpoint: the search policy {kind.name} has no setting {where}"
    others = [p.name for p in OWN if where in p.settings_type.model_fields]
    if others:
        hint = ": name the policy as well" if search.policy is None else ""
        return f"{said}; {', '.join(others)} {'have' if len(others) > 1 else 'has'} it{hint}"
    return f"{said}; it has {', '.join(kind.settings_type.model_fields)}"

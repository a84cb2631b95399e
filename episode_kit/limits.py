"""How much one simulator keeps, for everybody and for one owner, and for how long."""

from collections import Counter
from typing import NamedTuple

from service_kit.errors import BadQuestion, TooMany


class Limits(NamedTuple):
    """max_episodes: live at once, and of one owner (0: no such bound); lease_s: seconds without a call until one is
    ended, where its question does not say, and at most; kept_scenes: built scenes that stay though nobody flies in
    them."""

    max_episodes: int = 16
    max_per_owner: int = 0
    lease_s: float = 60.0
    max_lease_s: float = 3600.0
    kept_scenes: int = 4


def check_room(limits: Limits, begun: Counter[str | None], owner: str | None) -> None:
    """`begun`: how many episodes each owner has. Raises TooMany where there is no room for another of this one."""
    if begun.total() >= limits.max_episodes:
        raise TooMany(
            f"{limits.max_episodes} episodes are live, which is all that this simulator keeps; end one with "
            "DELETE /v1/episodes/<id>, or wait: one that nobody calls is ended when its lease has run out",
            code="too_many_episodes",
            details={"max_episodes": limits.max_episodes},
        )
    if owner is not None and 0 < limits.max_per_owner <= begun[owner]:
        raise TooMany(
            f"{limits.max_per_owner} episodes of this owner are live, which is all that one may have here; end one "
            "with DELETE /v1/episodes/<id>, or all with DELETE /v1/episodes?owner=<name>",
            code="too_many_episodes_of_owner",
            details={"max_episodes": limits.max_per_owner},
        )


def granted_lease_s(limits: Limits, wanted_s: float | None) -> float:
    """Raises BadQuestion where more is wanted than is granted."""
    if wanted_s is None:
        return limits.lease_s
    if wanted_s > limits.max_lease_s:
        raise BadQuestion(
            f"lease_s: {wanted_s:g} is longer than this simulator grants; ask for at most {limits.max_lease_s:g}, and "
            "renew it with POST /v1/episodes/<id>/renew",
            code="lease_too_long",
        )
    return wanted_s

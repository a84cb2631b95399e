"""Small pieces of HTML, every text escaped exactly once."""

from collections.abc import Iterable, Sequence
from html import escape

from evaluation.metrics.summary import Rate

VOID = frozenset({"img", "input", "link", "meta"})


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


def text(value: object) -> Html:
    """Markup as it is, everything else escaped."""
    return value if isinstance(value, Html) else Html(escape(str(value)))


def tag(name: str, *inside: object, **attributes: object) -> Html:
    """One element; an attribute that is None or False is left out, underscores in its name become hyphens."""
    given = "".join(
        f" {key.rstrip('_').replace('_', '-')}" + ("" if value is True else f'="{escape(str(value))}"')
        for key, value in attributes.items()
        if value is not None and value is not False
    )
    end = "" if name in VOID else f"{join(inside)}</{name}>"
    return Html(f"<{name}{given}>{end}")


def join(parts: Iterable[object]) -> Html:
    return Html("".join(text(part) for part in parts))


def percent(rate: float | None) -> str:
    return "n/a" if rate is None else f"{100 * rate:.1f}"


def interval(rate: Rate) -> str:
    """k of n, and the 95 % interval in percent."""
    if rate.low is None or rate.high is None:
        return f"{rate.k}/{rate.n}"
    return f"{rate.k}/{rate.n} · {100 * rate.low:.1f}–{100 * rate.high:.1f}"


def number(value: float | None, digits: int = 2) -> str:
    return "n/a" if value is None else f"{value:.{digits}f}"


def p_value(p: float | None) -> str:
    if p is None:
        return "n/a"
    return "< 0.001" if p < 0.001 else f"{p:.3f}"


def markdown(rows: Iterable[Sequence[str]]) -> str:
    """A table for a page of documentation; the first row is its head."""
    head, *rest = rows
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, ["---"] * len(head), *rest))

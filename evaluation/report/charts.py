"""The report's charts as inline SVG; colours come from the page's style, run k is class `r{k}`."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from evaluation.metrics.summary import Rate
from evaluation.report.markup import Html, join, percent, tag

WIDTH = 460
_LEFT, _RIGHT, _TOP, _BOTTOM = 40.0, 14.0, 14.0, 34.0


class Series(NamedTuple):
    """One run's points: position along the x axis, and the rate there."""

    run: int
    label: str
    points: Sequence[tuple[float, Rate]]


def curve(series: Sequence[Series], x_label: str, height: int = 280) -> Html:
    """Rates over a quantity, lines with their 95 % bands."""
    xs = sorted({x for one in series for x, _ in one.points})
    if not xs:
        return _empty()
    low, high = 0.0, xs[-1] * 1.04
    inner = (WIDTH - _LEFT - _RIGHT, height - _TOP - _BOTTOM)

    def at(x: float, y: float) -> tuple[float, float]:
        return _LEFT + (x - low) / (high - low) * inner[0], _TOP + (1.0 - y) * inner[1]

    parts = [_y_axis(at(low, 0)[0], at(high, 0)[0], lambda share: at(low, share)[1])]
    parts += [_label(at(x, 0)[0], height - _BOTTOM + 16, f"{x:g}", "middle") for x in xs]
    parts.append(_label(_LEFT + inner[0] / 2, height - 4, x_label, "middle"))
    known = [(one, [(x, r) for x, r in one.points if r.rate is not None]) for one in series]
    for one, points in known:
        band = [at(x, r.high or 0.0) for x, r in points] + [at(x, r.low or 0.0) for x, r in reversed(points)]
        parts.append(tag("polygon", points=_path(band), class_=f"band r{one.run}"))
    for one, points in known:
        line = [at(x, r.rate or 0.0) for x, r in points]
        parts.append(tag("polyline", points=_path(line), class_=f"line r{one.run}"))
        for (x, y), (radius, rate) in zip(line, points, strict=True):
            told = f"{one.label}: {percent(rate.rate)} % ({rate.k}/{rate.n}) at {radius:g}"
            parts.append(tag("circle", tag("title", told), cx=_r(x), cy=_r(y), r=3.5, class_=f"dot r{one.run}"))
    return _svg(height, parts, f"Rates by {x_label}")


def whiskers(groups: Mapping[str, Sequence[tuple[int, str, Rate]]], titles: Mapping[str, str]) -> Html:
    """One row a group and run: a dot with its 95 % interval, k/n beside it. `groups`: name -> (run, label, rate)."""
    rows = sum(len(rates) for rates in groups.values())
    if not rows:
        return _empty()
    left, right, pitch, gap = 112.0, 124.0, 17.0, 9.0
    height = round(_TOP + rows * pitch + len(groups) * gap + 26)
    inner = WIDTH - left - right

    def x(share: float) -> float:
        return left + share * inner

    parts = [_x_axis(x, _TOP - 4, height - 24, height - 8)]
    y = _TOP + pitch / 2
    for name, rates in groups.items():
        parts.append(_label(left - 10, y + (len(rates) - 1) * pitch / 2 + 4, _title(name, titles), "end", "ink"))
        for run, label, rate in rates:
            if rate.rate is not None and rate.low is not None and rate.high is not None:
                told = f"{_title(name, titles)}, {label}: {percent(rate.rate)} % ({rate.k}/{rate.n})"
                parts.append(
                    tag("line", x1=_r(x(rate.low)), x2=_r(x(rate.high)), y1=_r(y), y2=_r(y), class_=f"whisker r{run}")
                )
                parts.append(
                    tag("circle", tag("title", told), cx=_r(x(rate.rate)), cy=_r(y), r=4.5, class_=f"dot r{run}")
                )
            parts.append(_label(WIDTH - right + 10, y + 4, f"{percent(rate.rate)} ({rate.k}/{rate.n})", "start"))
            y += pitch
        y += gap
    return _svg(height, parts, "Success by group")


def bars(rows: Mapping[str, Sequence[tuple[int, str, int, int]]], titles: Mapping[str, str]) -> Html:
    """Counts as horizontal bars, one a name and run: name -> (run, label, k, n); lengths are shares of n."""
    count = sum(len(values) for values in rows.values())
    if not count:
        return _empty()
    left, right, pitch, gap = 118.0, 110.0, 15.0, 8.0
    height = round(_TOP + count * pitch + len(rows) * gap + 4)
    inner = WIDTH - left - right
    longest = max((k / n for values in rows.values() for _, _, k, n in values if n), default=1.0) or 1.0
    parts: list[Html] = []
    y = _TOP
    for name, values in rows.items():
        parts.append(_label(left - 10, y + len(values) * pitch / 2 + 4, _title(name, titles), "end", "ink"))
        for run, label, k, n in values:
            share = k / n if n else 0.0
            told = f"{_title(name, titles)}, {label}: {k} of {n}"
            parts.append(
                tag(
                    "rect",
                    tag("title", told),
                    x=_r(left),
                    y=_r(y + 2),
                    height=_r(pitch - 4),
                    width=_r(max(share / longest * inner, 1.0)),
                    rx=2,
                    class_=f"bar r{run}",
                )
            )
            end = left + share / longest * inner
            parts.append(_label(end + 7, y + pitch / 2 + 4, f"{k}  ({percent(share)} %)", "start"))
            y += pitch
        y += gap
    return _svg(height, parts, "Outcomes")


def _title(name: str, titles: Mapping[str, str]) -> str:
    # a single letter is a shape: an L, a T, a U
    return titles.get(name, name.upper() if len(name) == 1 else name.replace("_", " ").strip())


def _y_axis(left: float, right: float, y: Callable[[float], float]) -> Html:
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        at = y(share)
        parts.append(tag("line", x1=_r(left), x2=_r(right), y1=_r(at), y2=_r(at), class_="grid"))
        parts.append(_label(left - 6, at + 4, f"{100 * share:.0f}", "end"))
    return join(parts)


def _x_axis(x: Callable[[float], float], top: float, bottom: float, text_y: float) -> Html:
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        at = x(share)
        parts.append(tag("line", x1=_r(at), x2=_r(at), y1=_r(top), y2=_r(bottom), class_="grid"))
        parts.append(_label(at, text_y, f"{100 * share:.0f}", "middle"))
    return join(parts)


def _svg(height: int, parts: Sequence[Html], name: str) -> Html:
    return tag("svg", *parts, viewBox=f"0 0 {WIDTH} {height}", class_="chart", role="img", aria_label=name)


def _label(x: float, y: float, words: str, anchor: str, kind: str = "soft") -> Html:
    return tag("text", words, x=_r(x), y=_r(y), text_anchor=anchor, class_=kind)


def _path(points: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{_r(x)},{_r(y)}" for x, y in points)


def _r(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


def _empty() -> Html:
    return tag("p", "nothing flown yet", class_="soft")

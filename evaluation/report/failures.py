"""Every failure as a card: what was asked, what happened, where it flew, what it saw."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, get_args

from contracts.events import Event
from evaluation.metrics.episode import EpisodeRecord, Reason
from evaluation.metrics.floor_localization import height_error_m
from evaluation.report.markup import Html, join, number, tag
from evaluation.report.pictures import DEFAULT_BYTES, Album, Shown, evidence, most_telling
from evaluation.report.plan import flight_of, height_profile, plan_key, plan_view
from evaluation.report.runs import Run
from evaluation.scene_generator.scene_plan import Difficulty
from evaluation.task_set.task import Task
from mission.record import read_events
from mission.wording import counted
from service_kit.addresses import REPLAY_PORT

REASONS: Mapping[str, str] = {
    "success": "success",
    "parse": "parse",
    "floor": "floor",
    "missed_object": "missed object",
    "wrong_object": "wrong object",
    "lost_building": "lost the building",
    "blocked": "blocked",
    "collision": "collision",
    "timeout": "timeout",
    "unreadable": "unreadable",
    "unreachable": "unreachable",
    "error": "error",
}
_MOST_EVENTS = 80


class Failure(NamedTuple):
    """One failed episode, with what its record holds, if the run kept it."""

    run: int
    task: Task
    record: EpisodeRecord
    folder: Path | None
    events: Sequence[Event]
    shown: Sequence[Shown]


def failures_of(runs: Sequence[Run]) -> list[Failure]:
    """All failures of all runs, run by run, in the order of the tasks."""
    found = []
    for number_, run in enumerate(runs):
        for record in sorted(run.records, key=lambda record: record.task):
            if record.success:
                continue
            task = run.tasks[record.task]
            folder = _inside(run.folder, record.folder)
            events = read_events(folder) if folder is not None else []
            found.append(Failure(number_, task, record, folder, events, evidence(task, record.reason, events)))
    return found


def gallery(runs: Sequence[Run], failures: Sequence[Failure], limit_bytes: int = DEFAULT_BYTES) -> Html:
    """The filters and the cards."""
    if not failures:
        return tag("p", "No episode failed.", class_="soft")
    kept = most_telling([failure.shown for failure in failures], limit_bytes)
    failures = [failure._replace(shown=shown) for failure, shown in zip(failures, kept, strict=True)]
    album = Album(sum(map(len, kept)), limit_bytes)
    cards = [_card(runs, failure, album) for failure in failures]
    left_out = (
        tag("p", f"{counted(album.left_out, 'picture')} left out to keep this page below its size.", class_="soft")
        if album.left_out
        else ""
    )
    return join(
        (
            plan_key(),
            _kept(runs, failures),
            _filters(runs, failures),
            left_out,
            tag("div", *cards, class_="cards", id="cards"),
        )
    )


def _kept(runs: Sequence[Run], failures: Sequence[Failure]) -> Html:
    """Which runs have no pictures to show, and how to get some."""
    without = [
        run.label for k, run in enumerate(runs) if not any(f.folder for f in failures if f.run == k) and _failed(run)
    ]
    if not without:
        return Html("")
    told = f"Without pictures and with straight tracks from stop to stop: {'; '.join(without)}. "
    return tag("p", told, tag("code", "logisticsvln bench --pictures failures"), " keeps them.", class_="soft")


def _failed(run: Run) -> bool:
    return any(not record.success for record in run.records)


def _filters(runs: Sequence[Run], failures: Sequence[Failure]) -> Html:
    reasons = Counter(failure.record.reason for failure in failures)
    levels = Counter(failure.task.difficulty for failure in failures)
    chips = [_chip("reason", r, REASONS[r], reasons[r]) for r in get_args(Reason) if reasons[r]]
    hard = [_chip("difficulty", d, d, levels[d]) for d in get_args(Difficulty) if levels[d]]
    rows = [tag("div", tag("span", "Reason", class_="soft"), *chips, class_="chips")]
    rows.append(tag("div", tag("span", "Difficulty", class_="soft"), *hard, class_="chips"))
    if len(runs) > 1:
        of_run = Counter(failure.run for failure in failures)
        rows.append(
            tag(
                "div",
                tag("span", "Run", class_="soft"),
                *(_chip("run", str(k), run.label, of_run[k], k) for k, run in enumerate(runs) if of_run[k]),
                class_="chips",
            )
        )
    search = tag(
        "div",
        tag("input", type="search", id="search", placeholder="task, request, message …", aria_label="Search failures"),
        tag("span", counted(len(failures), "failure"), id="shown", class_="soft", aria_live="polite"),
        class_="chips",
    )
    return tag("div", *rows, search, class_="filters card", id="filters")


def _chip(group: str, value: str, label: str, count: int, run: int | None = None) -> Html:
    key = tag("i", class_=f"key r{run}") if run is not None else ""
    return tag(
        "button",
        key,
        label,
        tag("small", count),
        type="button",
        aria_pressed="false",
        data_group=group,
        data_value=value,
    )


def _card(runs: Sequence[Run], failure: Failure, album: Album) -> Html:
    task, record = failure.task, failure.record
    flight = flight_of(task, record.result, failure.events)
    search = " ".join((task.id, task.request, task.object, record.error or "", _message(record))).casefold()
    return tag(
        "article",
        tag(
            "header",
            tag("b", task.id),
            tag("span", REASONS[record.reason], class_="reason"),
            tag("span", tag("i", class_=f"key r{failure.run}"), runs[failure.run].label, class_="soft"),
        ),
        tag("blockquote", task.request),
        tag(
            "div",
            tag("div", plan_view(task, flight, good=False), height_profile(task, flight), class_="where"),
            tag("div", tag("p", _message(record), class_="message"), _facts(task, record), class_="what"),
            class_="body",
        ),
        _pictures(failure, album),
        _steps(failure.events),
        _replay(failure, runs[failure.run]),
        class_="card failure",
        data_reason=record.reason,
        data_run=failure.run,
        data_difficulty=task.difficulty,
        data_text=search,
    )


def _message(record: EpisodeRecord) -> str:
    if record.result is not None:
        return record.result.message
    return record.error or "the episode broke without a word"


def _facts(task: Task, record: EpisodeRecord) -> Html:
    building = task.building_kind.replace("_", "-")
    rows = [
        ("asked for", f"floor {task.floor}, {task.object}"),
        ("task", f"{task.difficulty}, {building}, {counted(task.floors, 'floor')}, {counted(task.corners, 'corner')}"),
    ]
    result = record.result
    if result is not None:
        error_m = height_error_m(task, result)
        understood = f"floor {result.floor or '?'}, {result.object or 'no object'}"
        rows.append(("understood", understood))
        rows.append(("height found", "none" if error_m is None else f"{error_m:.1f} m off"))
        if result.verdict is not None:
            rows.append(("stopped", f"{number(result.verdict.distance_m, 1)} m from the window's centre"))
        rows.append(("flown", f"{result.path_m:.0f} m, shortest {task.shortest_spatial_m:.0f} m"))
        rows.append(("stops", f"{result.steps}, {result.exploration_steps} exploring"))
    rows.append(("wall time", f"{record.wall_s:.1f} s"))
    if result is not None and record.error:
        rows.append(("error", record.error))
    return tag("dl", *(join((tag("dt", name), tag("dd", value))) for name, value in rows))


def _pictures(failure: Failure, album: Album) -> Html:
    if failure.folder is None or not failure.shown:
        return Html("")
    figures = []
    for one in failure.shown:
        picture = album.picture(failure.folder / "pictures" / one.name, one.caption)
        if picture is not None:
            image = tag("img", src=picture.source, alt=picture.caption, loading="lazy")
            figures.append(tag("figure", image, tag("figcaption", picture.caption)))
    return tag("div", *figures, class_="pictures") if figures else Html("")


def _steps(events: Sequence[Event]) -> Html:
    told = [event for event in events if event.kind not in ("phase", "result")]
    if not told:
        return Html("")
    lines = [tag("li", event.message, value=event.number) for event in told[:_MOST_EVENTS]]
    if len(told) > _MOST_EVENTS:
        lines.append(tag("li", f"and {len(told) - _MOST_EVENTS} more"))
    return tag("details", tag("summary", f"What happened, {counted(len(told), 'event')}"), tag("ol", *lines))


def _replay(failure: Failure, run: Run) -> Html:
    """The way to the same episode in the viewer, which runs while somebody has started it."""
    if failure.folder is None:
        return Html("")
    link = tag("a", "replay", href=f"http://127.0.0.1:{REPLAY_PORT}/#/delivery/{failure.folder.name}")
    return tag("p", link, " while ", tag("code", f"logisticsvln replay {run.folder}"), " runs", class_="soft")


def _inside(run: Path, folder: str | None) -> Path | None:
    """The episode's folder, which must lie in the run's."""
    if folder is None:
        return None
    root = run.resolve()
    path = (root / folder).resolve()
    return path if path.is_relative_to(root) and path.is_dir() else None

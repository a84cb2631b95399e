"""A delivery in the terminal: a live view where there is one, else one plain line an event."""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from command_line.console import Printed, Redrawn
from contracts.events import (
    BuildingBoxEvent,
    DirectionEvent,
    Event,
    FloorCountEvent,
    LookEvent,
    MoveEvent,
    ParsedEvent,
    PhaseEvent,
    PlacedEvent,
    ResultEvent,
    StandOffEvent,
    TurnEvent,
)
from contracts.geometry import Pose
from contracts.orchestrator import DeliveryResult, ModelCalls
from mission.wording import counted

PHASES = ("parse", "place", "floors", "explore", "approach", "claim")
MOST_LINES, FEWEST_LINES, OTHER_LINES = 16, 4, 18
STYLES = {
    "parsed": "cyan",
    "question": "bold yellow",
    "answer": "bold yellow",
    "floor_count": "cyan",
    "building_box": "cyan",
    "look": "yellow",
    "direction": "magenta",
    "lost": "red",
    "outage": "bold yellow",
    "verdict": "bold",
}
Show = Callable[[Event], None]


class PlainView(Printed):
    """One line an event: for pipes, logs and CI."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def show(self, event: Event) -> None:
        line = f"{event.time_s:7.2f} s  {event.phase:<8}  {event.message}"
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)

    def note(self, message: str) -> None:
        self._console.print(message, markup=False, highlight=False, soft_wrap=True)


class LiveView(Redrawn):
    """Phases, the last events, and who was asked how often and for how long."""

    def __init__(self, console: Console, request: str, backend: str | None) -> None:
        self._request, self._backend = request, backend
        self._events: deque[Event] = deque(maxlen=MOST_LINES)
        self._console = console
        self._asked: dict[str, tuple[int, int, float]] = {}
        self._facts: dict[str, str] = {}
        self._reached: list[str] = []
        self._note = "starting the services"
        super().__init__(Live(console=console, refresh_per_second=8, get_renderable=self._picture))

    def note(self, message: str) -> None:
        self._note = message

    def show(self, event: Event) -> None:
        self._note = ""
        if isinstance(event, PhaseEvent):
            if event.phase not in self._reached:
                self._reached.append(event.phase)
        else:
            self._events.append(event)
        self._learn(event)

    def _learn(self, event: Event) -> None:
        call, pose = _model_call(event), _pose(event)
        if call is not None:
            calls, hits, spent = self._asked.get(call.role, (0, 0, 0.0))
            self._asked[call.role] = (calls + 1, hits + int(call.cached), spent + call.seconds)
        if isinstance(event, ParsedEvent):
            self._facts["wanted"] = event.message
        if pose is not None:
            self._facts["drone"] = f"x {pose.x:.1f}  y {pose.y:.1f}  height {pose.z:.1f} m"
        if isinstance(event, LookEvent) and event.phase == "explore":
            self._facts["exploration step"] = str(event.data.exploration_step)

    def _picture(self) -> RenderableType:
        bar = Text()
        over = bool(self._events) and isinstance(self._events[-1], ResultEvent)
        now = self._reached[-1] if self._reached and not over else ""
        for phase in PHASES:
            mark, style = ("▶ ", "bold yellow") if phase == now else ("✔ ", "green")
            if phase not in self._reached:
                mark, style = "· ", "dim"
            bar.append(f" {mark}{phase} ", style)
        lines = Table.grid(padding=(0, 1))
        lines.add_column(justify="right", style="dim", no_wrap=True)
        lines.add_column(no_wrap=True, width=8)
        lines.add_column(overflow="fold")
        room = max(FEWEST_LINES, self._console.size.height - OTHER_LINES)
        for event in list(self._events)[-room:]:
            lines.add_row(f"{event.time_s:.1f} s", event.phase, Text(event.message, STYLES.get(event.kind, "")))
        if self._note:
            lines.add_row("", "", Text(self._note, "dim"))
        figures = Table.grid(padding=(0, 2))
        for name, value in self._facts.items():
            figures.add_row(Text(name, "dim"), value)
        for role, (calls, hits, spent) in self._asked.items():
            cached = f", {hits} cached" if hits else ""
            figures.add_row(Text(f"model: {role}", "dim"), f"{counted(calls, 'call')}{cached}, {spent:.2f} s")
        title = Text(f"“{self._request}”", "bold", overflow="fold")
        body = Group(title, Text(), bar, Text(), lines, Text(), figures)
        return Panel(
            body, title=" · ".join(filter(None, ("LogisticsVLN", self._backend))), border_style="blue", padding=(1, 2)
        )


class ModelCall(NamedTuple):
    """A question to a model, as an event tells of it."""

    role: str
    seconds: float
    cached: bool


def _model_call(event: Event) -> ModelCall | None:
    match event:
        case ParsedEvent():
            return ModelCall("parser", event.data.seconds, cached=False)
        case FloorCountEvent() | BuildingBoxEvent() | LookEvent() | DirectionEvent():
            answer, seconds = event.data.answer, event.data.seconds
            if answer is None:
                return None
            spent = seconds if seconds is not None else answer.latency_s
            return ModelCall(answer.role, spent, cached=answer.cache == "hit")
        case _:
            return None


def _pose(event: Event) -> Pose | None:
    """Where the drone was measured to be."""
    match event:
        case MoveEvent() | TurnEvent():
            return event.data.to
        case PlacedEvent() | StandOffEvent() | FloorCountEvent() | BuildingBoxEvent() | LookEvent():
            return event.data.pose
        case _:
            return None


def print_result(console: Console, result: DeliveryResult, folder: str) -> None:
    """The end, for a person: how it went, what it cost, where the pictures are."""
    style = {"delivered": "bold green", "stopped_not_judged": "bold yellow"}.get(result.outcome, "bold red")
    console.print(Text(result.outcome.replace("_", " ").upper(), style), end="  ")
    console.print(result.message, markup=False, highlight=False, soft_wrap=True)
    calls = ", ".join(_told(role, asked) for role, asked in result.model_calls.items())
    facts = [
        ("steps", f"{counted(result.steps, 'stop')} with a model query, {result.exploration_steps} of them exploring"),
        ("flown", f"{result.path_m:.1f} m in {result.flight_s:.0f} s of flight"),
        ("model calls", calls or "none"),
        ("wall time", f"{_wall(result)}; pictures by {result.renderer or 'nobody'}"),
        ("record", folder),
        ("picture", f"{folder}/summary.png"),
    ]
    table = Table.grid(padding=(0, 2))
    for name, value in facts:
        table.add_row(Text(name, "dim"), Text(value, overflow="fold"))
    console.print(table)


def _wall(result: DeliveryResult) -> str:
    return f"{result.timings_s.get('total', 0.0):.1f} s for the mission, without the writing of state and summary"


def _told(role: str, asked: ModelCalls) -> str:
    """How often a role was asked, and who answered: "recognition 6 by embedded-4 (6 cached)"."""
    by = f" by {' and '.join(asked.models)}" if asked.models else ""
    cached = f" ({asked.cache_hits} cached)" if asked.cache_hits else ""
    return f"{role} {asked.calls}{by}{cached}"

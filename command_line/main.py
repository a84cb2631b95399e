"""`logisticsvln`: all commands under one name. What a command needs is loaded when it is run, and not to list it."""

import importlib
import signal
from typing import Any, NamedTuple

import typer
import typer.core
import typer.main


class Listed(NamedTuple):
    """A command before it is loaded: the module of this package that has it, and what it is for in a few words."""

    module: str
    about: str


COMMANDS = {
    "deliver": Listed("deliver", "Fly one delivery and show it live."),
    "serve": Listed("serve", "Run all services as processes of this machine, or one by name, until Ctrl-C."),
    "doctor": Listed("doctor", "Look whether this machine has what is needed, and say what to do where it has not."),
    "vehicles": Listed("vehicles", "List the vehicles of a running orchestrator's fleet."),
    "recording": Listed("recording", "Put the gateway's recorded answers into one file, or take them out of one."),
    "samples": Listed("samples", "List the deliveries that ship with the project."),
    "scene": Listed("scene", "Scenes of your own: look at one, make one from a few questions or from a map."),
    "tasks": Listed("tasks", "The task set: make fresh ones, look at single tasks, count what is in them."),
    "bench": Listed("bench", "Fly a task set and print the figures; put the shards of a run together."),
    "worker": Listed("worker", "Fly what `bench --database` has queued, on this machine."),
    "report": Listed("report", "One HTML page of runs: the paper's tables with ours beside them, and every failure."),
    "compare": Listed("report", "Runs side by side, with paired tests against the first."),
    "submit": Listed("submit", "A run as a row of the leaderboard; --check flies it again with its recorded answers."),
    "export": Listed("export", "A run's flights as a dataset or recordings: LeRobot, Rerun, MCAP, COCO."),
    "replay": Listed("replay", "Look at the records of a run in the browser, while it is flown or afterwards."),
    "evaluate": Listed("evaluate", "Measure a vision model on fresh streets."),
}


class LoadedWhenRun(typer.core.TyperGroup):
    """A group that lists commands by what stands here about them, and imports the module of the one that is run."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name, listed, rest = super().resolve_command(ctx, args)
        if name is None or listed is None:
            return name, listed, rest
        loaded = _loaded(name)
        if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:  # as `__main__` left it
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return name, loaded, rest

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            from contracts.errors import without_prefix

            error.message = without_prefix(error.message)
            raise


app = typer.Typer(
    name="logisticsvln",
    cls=LoadedWhenRun,
    help="Vision-language drone delivery to a window: from a sentence to a safe stop.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _not_loaded() -> None:
    """Stands for a command in the list of all."""


for _name, _listed in COMMANDS.items():
    app.command(_name, help=_listed.about)(_not_loaded)


def _loaded(name: str) -> Any:
    """The command: the module's `app` where it has one, else its function of that name."""
    module = importlib.import_module(f"command_line.{COMMANDS[name].module}")
    own = getattr(module, "app", None)
    if not isinstance(own, typer.Typer):
        own = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        own.command(name)(getattr(module, name))
    return typer.main.get_command(own)

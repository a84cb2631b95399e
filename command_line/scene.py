"""`logisticsvln scene`: look at a scene of one's own, make one from a few questions, or from a map."""

import json
import re
import sys
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError
from rich.console import Console

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, stop
from command_line.mission_options import SEED_HIGH
from command_line.scene_questions import Neighbours, Questions
from contracts.errors import first_problem, what_is_wrong
from contracts.scene import SCHEMA_KEY, BuildingKind, Scene
from contracts.scene_schema import schema_text
from evaluation.own_scenes.check import Problem, problems_of
from evaluation.own_scenes.osm_file import BadMap, LatLon, read_map
from evaluation.own_scenes.osm_scene import Thing, Wanted, scene_of
from evaluation.own_scenes.preview import draw_preview
from evaluation.own_scenes.starts import walkable_starts
from evaluation.scene_generator.placement import entry_of
from evaluation.scene_generator.scene_plan import Shape, UnbuildableScene
from evaluation.scene_generator.scenes import build_scene
from evaluation.sim_client import SimulatorFault, own_simulator
from logisticsvln.scenes import BadScene, read_scene
from mission.record import write_whole
from mission.wording import counted

SCHEMA_FILE = "scene.schema.json"
ThingKind = Annotated[str | None, typer.Option("--object", help="What marks the window: a class of the catalogue.")]

app = typer.Typer(
    help="Scenes of your own: look at one, make one from a few questions or from a map.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.command()
def preview(
    file: Annotated[Path, typer.Argument(help="A scene document (JSON; docs/scenes.md).")],
    out: Annotated[Path | None, typer.Option(help="The picture.", show_default="beside FILE, as PNG")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Find what is wrong with a scene and draw it: the plan with the places where a drone may start, the street from
    above, the first look, the goal's window. Ends with code 1 where it can't be flown in."""
    scene = _read(file)
    path = out or file.with_suffix(".png")
    starts = walkable_starts(scene)
    try:
        with own_simulator() as simulator:
            problems = problems_of(scene, simulator)
            sound = not any(problem.weight == "error" for problem in problems)
            draw_preview(scene, starts, problems, simulator if sound else None, path)
    except SimulatorFault as error:
        stop(str(error), FAILED)
    except OSError as error:
        stop(f"{path} can't be written: {error.strerror or error}", WRONG_INPUT)
    if as_json:
        told = {
            "scene": scene.name,
            "picture": str(path),
            "problems": [problem._asdict() for problem in problems],
            "starts": [{"x": s.x, "y": s.y, "yaw": round(s.yaw, 4)} for s in starts],
        }
        typer.echo(json.dumps(told, ensure_ascii=False))
    else:
        _tell(problems)
        found = f"{counted(len(problems), 'problem')} found" if problems else "no problem found"
        typer.echo(f"{found}; {counted(len(starts), 'place')} to start from; {path}")
    if not sound:
        raise typer.Exit(FAILED)


@app.command()
def new(
    out: Annotated[Path, typer.Argument(help="The scene document to write.")],
    kind: Annotated[BuildingKind | None, typer.Option(help="Of the building.")] = None,
    shape: Annotated[Shape | None, typer.Option(help="Of its ground plan.")] = None,
    floors: Annotated[int | None, typer.Option(min=1, max=40)] = None,
    thing: ThingKind = None,
    colour: Annotated[str | None, typer.Option(help="Of the thing.")] = None,
    floor: Annotated[int | None, typer.Option(min=1, max=40, help="Where it is.")] = None,
    corners: Annotated[
        int | None, typer.Option(min=0, max=11, help="How many corners of the building lie between start and window.")
    ] = None,
    neighbours: Annotated[Neighbours | None, typer.Option(help="What else stands there.")] = None,
    seed: Annotated[int, typer.Option(min=0, max=SEED_HIGH, help="Decides whatever is not asked.")] = 0,
) -> None:
    """Make a scene from a few questions: what the options leave open is asked on a terminal, and takes its usual value
    without one."""
    _must_be_new(out)
    try:
        with own_simulator() as simulator:
            catalogue = simulator.catalogue()
        spec = Questions(catalogue, interactive=sys.stdin.isatty()).spec(
            name=_name_of(out),
            kind=kind,
            shape=shape,
            floors=floors,
            thing=thing,
            colour=colour,
            floor=floor,
            corners=corners,
            neighbours=neighbours,
        )
        write_scene(build_scene(spec, seed, catalogue), out)
    except ValidationError as error:
        stop(first_problem(error), WRONG_INPUT)
    except UnbuildableScene as error:
        stop(str(error), WRONG_INPUT)
    except SimulatorFault as error:
        stop(str(error), FAILED)
    except OSError as error:
        stop(f"{out} can't be written: {error.strerror}", WRONG_INPUT)
    except (KeyboardInterrupt, typer.Abort):
        stop("interrupted; nothing was written", INTERRUPTED)
    goal = spec.goal
    what = f"{goal.colour} {entry_of(catalogue, goal.kind).phrase}"
    typer.echo(f"{out}: look at it with `logisticsvln scene preview {out}`, deliver with")
    typer.echo(f'logisticsvln deliver "floor {goal.floor}, the window with the {what}" --scene {out}')


@app.command(name="from-osm")
def from_osm(
    file: Annotated[Path, typer.Argument(help="An OpenStreetMap extract of some streets (.osm).")],
    out: Annotated[Path, typer.Option(help="The scene document to write.")],
    target: Annotated[
        str | None, typer.Option(help="The building to deliver to: way/123, or the number alone.")
    ] = None,
    at: Annotated[str | None, typer.Option(help="Or the building nearest to LAT,LON.", metavar="LAT,LON")] = None,
    around: Annotated[
        float, typer.Option(min=0, max=300, help="Metres from it that other buildings are taken.")
    ] = 60.0,
    levels: Annotated[int, typer.Option(min=1, max=60, help="Floors of a building that tells none.")] = 3,
    thing: ThingKind = None,
    colour: Annotated[str, typer.Option(help="Of the thing.")] = "red",
    floor: Annotated[int, typer.Option(min=1, max=60, help="Where it is.")] = 2,
    seed: Annotated[int, typer.Option(min=0, max=SEED_HIGH, help="Decides whatever the map does not say.")] = 0,
) -> None:
    """Make a scene from a map that you have: footprints and levels of buildings, roads, trees. Nothing is fetched."""
    _must_be_new(out)
    wanted = Wanted(
        name=_name_of(out),
        target=target,
        at=None if at is None else _lat_lon(at),
        around_m=around,
        levels=levels,
        thing=None if thing is None else Thing(thing, colour, floor),
        seed=seed,
    )
    try:
        found = read_map(file)
        if wanted.thing is not None:
            with own_simulator() as simulator:
                entry_of(simulator.catalogue(), wanted.thing.kind, wanted.thing.colour)
        made = scene_of(found, wanted)
        write_scene(made.scene, out)
    except (BadMap, UnbuildableScene) as error:
        stop(str(error), WRONG_INPUT)
    except SimulatorFault as error:
        stop(str(error), FAILED)
    except KeyboardInterrupt:
        stop("interrupted; nothing was written", INTERRUPTED)
    except OSError as error:
        stop(f"{out} can't be written: {error.strerror}", WRONG_INPUT)
    for line in made.told:
        typer.echo(line)
    typer.echo(f"{out}: look at it with `logisticsvln scene preview {out}`")


def write_scene(scene: Scene, path: Path) -> None:
    """In one piece, and the schema that it names, for editors, beside it. Raises OSError."""
    named = {SCHEMA_KEY: f"./{SCHEMA_FILE}"} | scene.model_dump(mode="json")
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path.with_name(SCHEMA_FILE), schema_text())
    write_whole(path, json.dumps(named, indent=1, ensure_ascii=False) + "\n")


def _must_be_new(path: Path) -> None:
    if path.exists():
        stop(f"{path} is there already; name another file", WRONG_INPUT)


def _name_of(path: Path) -> str:
    """The scene's name from its file's."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", path.stem).strip("-._") or "scene"


def _lat_lon(text: str) -> LatLon:
    found = re.fullmatch(r"\s*(-?\d+(?:\.\d+)?)\s*,\s*(-?\d+(?:\.\d+)?)\s*", text)
    if found is None:
        stop(f"--at: {text!r} is not LAT,LON, such as 48.8583,2.2945", WRONG_INPUT)
    return LatLon(float(found.group(1)), float(found.group(2)))


def _read(file: Path) -> Scene:
    """The scene; ends the command with every problem of its form, one a line."""
    try:
        return read_scene(file)
    except BadScene as error:
        cause = error.__context__
        if isinstance(cause, ValidationError) and len(cause.errors()) > 1:
            for problem in cause.errors()[:20]:
                where = ".".join(str(part) for part in problem["loc"])
                typer.echo(f"error: {where}: {what_is_wrong(problem, cause.title)}", err=True)
        stop(str(error), WRONG_INPUT)


def _tell(problems: list[Problem]) -> None:
    console = Console()
    for problem in problems:
        style = "red" if problem.weight == "error" else "yellow"
        console.print(f"[{style}]{problem.weight}[/]: ", end="", highlight=False)
        console.print(problem.text, markup=False, highlight=False, soft_wrap=True)

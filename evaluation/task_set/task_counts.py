"""What is in a task set, counted; and the page that shows it, with the paper's four charts."""

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from contracts.base import Wire
from contracts.scene import BuildingKind
from evaluation.scene_generator.scene_plan import Difficulty
from evaluation.task_set.task import Category, Task
from evaluation.task_set.task_files import TaskSet

_INK, _SOFT = "#2b3440", "#8a94a0"
_FILLS = ("#4c78a8", "#e08a3c", "#59a07c", "#c25b5b", "#8c7bb8", "#b59a4a", "#5aa5b5", "#b0779a")


class TaskCounts(Wire):
    """Counts of tasks by kind; `floor` by the floor delivered to. `decoys` counts tasks with at least one, by what it
    has in common with the goal; `quartiles_m` of the shortest horizontal way."""

    name: str
    checksum: str
    tasks: int
    buildings: int
    seeds: tuple[int, int]
    category: dict[str, int]
    building_kind: dict[str, int]
    footprint: dict[str, int]
    floor: dict[str, int]
    highest_building_floors: int
    difficulty: dict[str, int]
    corners: dict[str, int]
    sky: dict[str, int]
    style: dict[str, int]
    object_kinds: int
    templates: int
    decoys: dict[str, int]
    with_neighbours: int
    quartiles_m: tuple[float, float, float]
    bytes_of_scenes: int


def count_tasks(chosen: TaskSet) -> TaskCounts:
    """Counts a set."""
    tasks = chosen.tasks
    ways = sorted(task.shortest_horizontal_m for task in tasks)
    floors = Counter(task.floor for task in tasks)
    return TaskCounts(
        name=chosen.name,
        checksum=chosen.checksum,
        tasks=len(tasks),
        buildings=len({task.building for task in tasks}),
        seeds=(min(t.seed for t in tasks), max(t.seed for t in tasks)),
        category=_counted([t.category for t in tasks], get_args(Category)),
        building_kind=_counted([t.building_kind for t in tasks], get_args(BuildingKind)),
        footprint=dict(Counter(t.footprint for t in tasks).most_common()),
        floor={str(f): floors[f] for f in sorted(floors)},
        highest_building_floors=max(t.floors for t in tasks),
        difficulty=_counted([t.difficulty for t in tasks], get_args(Difficulty)),
        corners={str(k): n for k, n in sorted(Counter(t.corners for t in tasks).items())},
        sky=dict(Counter(t.scene.light.sky for t in tasks).most_common()),
        style=dict(Counter(t.style for t in tasks).most_common()),
        object_kinds=len({t.object_kind for t in tasks}),
        templates=len({t.template for t in tasks}),
        decoys={
            "same class, other colour": sum(_decoy(t, kind=True, colour=False) for t in tasks),
            "same colour, other class": sum(_decoy(t, kind=False, colour=True) for t in tasks),
            "same thing elsewhere": sum(_decoy(t, kind=True, colour=True) for t in tasks),
        },
        with_neighbours=sum(len(t.scene.buildings) > 1 for t in tasks),
        quartiles_m=(_quantile(ways, 0.25), _quantile(ways, 0.5), _quantile(ways, 0.75)),
        bytes_of_scenes=sum(len(t.scene.model_dump_json()) for t in tasks),
    )


def write_page(found: TaskCounts, folder: Path) -> tuple[Path, Path]:
    """`NAME.md` and `NAME.png`. Raises ImportError without matplotlib, OSError."""
    name = Path(found.name).name.removesuffix(".zst").removesuffix(".jsonl").replace(" ", "-").replace(",", "")
    folder.mkdir(parents=True, exist_ok=True)
    picture = folder / f"{name}.png"
    draw_charts(found, picture)
    page = folder / f"{name}.md"
    page.write_text(_page(found, picture.name), encoding="utf-8")
    return page, picture


def draw_charts(found: TaskCounts, path: Path) -> None:
    """Categories, building types, floors, difficulty. Raises ImportError without matplotlib."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7.2), dpi=120, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    figure.suptitle(
        f"{Path(found.name).name}: {found.tasks} tasks, {found.buildings} buildings",
        color=_INK,
        fontsize=14,
        weight="bold",
    )
    (a, b), (c, d) = figure.subplots(2, 2)
    for axes, title, counts, unit in (
        (a, "Object category", found.category, ""),
        (b, "Building type", found.building_kind, ""),
        (c, "Target floor", found.floor, "floor"),
        (d, "Difficulty (corners to the target's facade)", found.difficulty, ""),
    ):
        names = [name.replace("_", "-") for name in counts]
        if title.startswith("Difficulty"):
            names = [f"{name}\n{rule}" for name, rule in zip(names, ("0-1", "2-3", "more than 3"), strict=True)]
        values = list(counts.values())
        colours = [_FILLS[0]] * len(values) if unit else [_FILLS[k % len(_FILLS)] for k in range(len(values))]
        horizontal = title == "Object category"
        if horizontal:
            bars = axes.barh(names[::-1], values[::-1], color=colours[::-1], height=0.72)
        else:
            bars = axes.bar(names, values, color=colours, width=0.72)
        labels = [f"{v}" if unit else f"{v} ({100 * v / found.tasks:.0f} %)" for v in values]
        axes.bar_label(bars, labels[::-1] if horizontal else labels, padding=3, color=_INK, fontsize=8.5)
        axes.set_title(title, loc="left", color=_INK, fontsize=11)
        axes.margins(**{"x" if horizontal else "y": 0.16})
        axes.tick_params(colors=_INK, length=0, labelsize=8 if unit else 9)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(_SOFT)
        axes.set_xlabel("tasks" if horizontal else unit, color=_SOFT, fontsize=9)
        axes.set_ylabel("" if horizontal else "tasks", color=_SOFT, fontsize=9)
    figure.savefig(path)


def _page(found: TaskCounts, picture: str) -> str:
    name = Path(found.name).name
    low, high = found.seeds
    quarter, middle, three = found.quartiles_m

    def listed(title: str, counts: dict[str, int]) -> str:
        rows = "\n".join(f"| {k.replace('_', ' ')} | {n} | {100 * n / found.tasks:.1f} % |" for k, n in counts.items())
        return f"| {title} | tasks | share |\n|---|---:|---:|\n{rows}\n"

    return f"""# {name}

{found.tasks} deliveries at {found.buildings} buildings. Made by `logisticsvln tasks stats {name} --out docs`, not by
hand.

![Object categories, building types, floors, difficulty]({picture})

- SHA-256 of the lines (verified whenever the set is loaded): `{found.checksum}`
- Seeds {low} to {high}. The test set takes the seeds 200,000-299,999; 0-99,999 are for fitting models and
  100,000-199,999 for choosing between them, so a model of this project has seen none of these scenes.
- {found.object_kinds} classes of objects, {found.templates} of the request templates in {len(found.style)} styles.
- The highest building has {found.highest_building_floors} floors.
- {found.with_neighbours} tasks have neighbouring buildings across the street or all round.
- The shortest way (on the plan) has a median of {middle:.1f} m, quartiles {quarter:.1f} m and {three:.1f} m.

Every task was flown once before it went in: along its shortest way, without touching anything, to a stop that the
simulator's own judge called delivered; and from a stop in front of its window the oracle saw the object. The way is
the shortest on the ground plan that keeps 0.8 m from all walls (1.3, 1.8 or 2.4 m where balconies or eaves are in
the way), to the nearest place within 3 m and 60 degrees of the window's normal; in space the drone climbs evenly along
it, or first of all where eaves forbid that.

Difficulty is the number of corners between the facade that the drone faces at the start and the target's: fewer than 2
easy, 2 or 3 moderate, more than 3 hard. Clockwise, the way the paper flies, is always the shorter way round, or as
short.

{listed("category", found.category)}
{listed("building type", found.building_kind)}
{listed("footprint", found.footprint)}
{listed("difficulty", found.difficulty)}
{listed("corners", found.corners)}
{listed("floor", found.floor)}
{listed("sky", found.sky)}
{listed("decoys", found.decoys)}
{listed("style of request", found.style)}"""


def _counted(values: Sequence[str], order: Sequence[str]) -> dict[str, int]:
    counts = Counter(values)
    return {name: counts[name] for name in order}


def _decoy(task: Task, *, kind: bool, colour: bool) -> bool:
    return any(
        (o.kind == task.object_kind) == kind and (o.colour == task.object_colour) == colour
        for o in task.scene.objects
        if o.id.startswith("decoy")
    )


def _quantile(ordered: Sequence[float], share: float) -> float:
    at = share * (len(ordered) - 1)
    low = math.floor(at)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (at - low) * (ordered[high] - ordered[low])

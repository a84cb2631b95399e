"""A run's figures, and its results as one flat table: a row an episode, task and result side by side."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.summary import Summary, summarize
from evaluation.task_set.task import Task
from mission.record import write_whole

Cell = str | int | float | bool | None


def write_figures(path: Path, tasks: Mapping[str, Task], records: Sequence[EpisodeRecord], wall_s: float) -> Summary:
    """Writes summary.json and results.parquet into a run's folder. `wall_s`: the run's own, seconds."""
    summary = summarize(tasks, records, wall_s)
    write_whole(path / "summary.json", summary.model_dump_json(indent=1) + "\n")
    write_parquet(path / "results.parquet", tasks, records)
    return summary


def row(task: Task, record: EpisodeRecord) -> dict[str, Cell]:
    """One episode; null where there is no result. Lengths in metres, times in seconds."""
    result = record.result
    verdict = result.verdict if result else None
    calls = list(result.model_calls.values()) if result else []
    return {
        "task": task.id,
        "seed": task.seed,
        "building": task.building,
        "building_kind": task.building_kind,
        "footprint": task.footprint,
        "floors": task.floors,
        "floor": task.floor,
        "category": task.category,
        "object": task.object,
        "object_kind": task.object_kind,
        "object_colour": task.object_colour,
        "difficulty": task.difficulty,
        "corners": task.corners,
        "template": task.template,
        "style": task.style,
        "request": task.request,
        "target_height_m": task.target_height_m,
        "shortest_horizontal_m": task.shortest_horizontal_m,
        "shortest_spatial_m": task.shortest_spatial_m,
        "clearance_m": task.clearance_m,
        "reason": record.reason,
        "success": record.success,
        "outcome": result.outcome if result else None,
        "message": result.message if result else None,
        "error": record.error,
        "steps": result.steps if result else None,
        "world_steps": verdict.steps if verdict else None,
        "sensors": result.sensors if result else None,
        "exploration_steps": result.exploration_steps if result else None,
        "path_m": result.path_m if result else None,
        "path_horizontal_m": result.path_horizontal_m if result else None,
        "flight_s": result.flight_s if result else None,
        "parsed_floor": result.floor if result else None,
        "parsed_object": result.object if result else None,
        "final_height_m": result.final_height_m if result else None,
        "claimed": verdict is not None if result else None,
        "right_window": verdict.right_window if verdict else None,
        "distance_m": verdict.distance_m if verdict else None,
        "nearest_window": verdict.nearest_window if verdict else None,
        "aside_deg": verdict.aside_deg if verdict else None,
        "in_front": verdict.in_front if verdict else None,
        "line_of_sight": verdict.line_of_sight if verdict else None,
        "collided": verdict.collided if verdict else None,
        "model_calls": sum(c.calls for c in calls),
        "cache_hits": sum(c.cache_hits for c in calls),
        "prompt_tokens": sum(c.prompt_tokens for c in calls),
        "completion_tokens": sum(c.completion_tokens for c in calls),
        "renderer": result.renderer if result else None,
        "started": record.started,
        "wall_s": record.wall_s,
        "render_s": record.render_s,
        "model_s": record.model_s,
    }


def write_parquet(path: Path, tasks: Mapping[str, Task], records: Sequence[EpisodeRecord]) -> bool:
    """False where pyarrow is not installed (extra `eval`), or there is no row: the JSON lines hold the same."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        return False
    if not records:
        return False
    rows = [row(tasks[record.task], record) for record in records]
    types = {name: _type_of(name, [r[name] for r in rows]) for name in rows[0]}
    arrow = {"str": pa.string(), "int": pa.int64(), "float": pa.float64(), "bool": pa.bool_()}
    schema = pa.schema([(name, arrow[kind]) for name, kind in types.items()])
    part = path.with_name(path.name + ".part")
    pq.write_table(pa.Table.from_pylist(rows, schema=schema), part, compression="zstd")
    part.replace(path)
    return True


_BOOLEAN = {"success", "claimed", "right_window", "nearest_window", "in_front", "line_of_sight", "collided"}
_WHOLE = {
    *("seed", "floors", "floor", "corners", "steps", "world_steps", "exploration_steps", "parsed_floor"),
    *("model_calls", "cache_hits", "prompt_tokens", "completion_tokens"),
}


def _type_of(name: str, values: Sequence[Cell]) -> str:
    """The column's type, the same in every run whatever its values happen to be."""
    if name in _BOOLEAN:
        return "bool"
    if name in _WHOLE:
        return "int"
    return "float" if name.endswith(("_m", "_s", "_deg")) else "str"

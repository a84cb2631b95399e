"""Runs as the report sees them: settings, tasks, results and figures, with a name for each arm."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, get_args

from pydantic import ValidationError

from contracts.orchestrator import MissionSettings
from evaluation.bench.folder import BadFolder, read_records, read_settings, read_tasks, read_wall_s
from evaluation.bench.run_settings import RunSettings
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.summary import Summary, summarize
from evaluation.subtasks.figures import Subtask, SubtaskScores
from evaluation.task_set.task import Task
from mission.policies import words_of


class Run(NamedTuple):
    """One run. `label` says in a few words how its arm differs; `tasks` are those it flew or was to fly, `contents`
    their digests (`Task.content`); `alone` are the figures of single roles that `bench --subtask --out` left in its
    folder."""

    label: str
    folder: Path
    settings: RunSettings
    tasks: Mapping[str, Task]
    records: Sequence[EpisodeRecord]
    summary: Summary
    contents: Mapping[str, str]
    alone: Sequence[SubtaskScores] = ()

    @property
    def model(self) -> str:
        """Who answered about pictures."""
        return answering(self.settings)

    @property
    def arm(self) -> MissionSettings:
        return self.settings.mission


def load_run(folder: Path) -> Run:
    """Reads a run, finished or not. Raises evaluation.bench.folder.BadFolder."""
    settings = read_settings(folder)
    tasks = {task.id: task for task in read_tasks(folder).tasks}
    records = read_records(folder)
    try:
        summary = summarize(tasks, records, read_wall_s(folder))
    except ValueError as error:
        raise BadFolder(f"{folder}: {error}") from None
    contents = {name: task.content for name, task in tasks.items()}
    return Run(label_of(settings), folder, settings, tasks, records, summary, contents, _alone(folder))


def load_runs(folders: Sequence[Path]) -> list[Run]:
    """Several runs; equal labels get their folders' names as well. Raises evaluation.bench.folder.BadFolder."""
    runs = [load_run(folder) for folder in folders]
    labels = [run.label for run in runs]
    return [
        run._replace(label=f"{run.label} ({run.folder.resolve().name})") if labels.count(run.label) > 1 else run
        for run in runs
    ]


def answering(settings: RunSettings) -> str:
    """Who answered about pictures: the back end, and what disturbed it."""
    noise = [f"{name.replace('_', ' ')} {value:g}" for name, value in settings.oracle.items() if value]
    noise = [words for words in noise if not words.startswith("noise seed")]
    return ", ".join([settings.backend, *noise])


def label_of(settings: RunSettings) -> str:
    """The back end, the way it searches, and whatever else is not as usual."""
    mission = settings.mission
    usual = MissionSettings()
    words = [answering(settings), *words_of(mission.viewpoint)]
    if mission.floors != usual.floors:
        words.append("direct count")
    if mission.sightings.policy != usual.sightings.policy:
        words.append("claims at first sight")
    if mission.rig != usual.rig:
        words.append(f"rig {mission.rig.name}")
    if mission.sensors is not None:
        words.append(f"sensors {mission.sensors.label}")
    if mission.band_reading != usual.band_reading:
        words.append("h_i as camera height")
    if settings.shard is not None:
        words.append(f"shard {settings.shard}")
    return ", ".join(words)


def _alone(folder: Path) -> list[SubtaskScores]:
    found = []
    for name in get_args(Subtask):
        try:
            found.append(SubtaskScores.model_validate_json((folder / f"{name}.json").read_bytes()))
        except FileNotFoundError:
            continue
        except (OSError, ValidationError):
            raise BadFolder(f"{folder / name}.json is not the figures of a subtask") from None
    return found

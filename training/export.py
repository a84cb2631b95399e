"""From checkpoints to the files that the gateway reads."""

import hashlib
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from contracts.sim import Catalogue
from services.sim.catalogue import CATALOGUE
from services.vlm_gateway.embedded.exported import (
    MODEL_FILE,
    NAMER_FILE,
    PROPOSER_FILE,
    Exported,
    Proposing,
)
from training.calibrate import PLAIN
from training.crop_store import CONTEXT, LEAST_PX
from training.int8 import Arranged, quantise
from training.nets import Namer, Proposer, ProposerAnswer
from training.render import colour_numbers, kind_numbers

OPSET = 17
CROP_PX = 64


def smoothed(checkpoint: Path, net: nn.Module) -> nn.Module:
    """The network with a checkpoint's smoothed weights. Raises OSError where there is no checkpoint."""
    net.load_state_dict(torch.load(checkpoint, weights_only=True, map_location="cpu")["smooth"])
    return net.eval()


def steps_of(checkpoint: Path) -> int:
    return int(torch.load(checkpoint, weights_only=True, map_location="cpu")["step"])


def write_proposer(net: Proposer, path: Path, pictures: Iterable[NDArray[np.uint8]]) -> None:
    """In integers, whose ranges come from `pictures`, (H, W, 3) each."""
    with TemporaryDirectory(dir=path.parent) as folder:
        plain = Path(folder) / path.name
        write_float_proposer(Arranged(net), plain)
        quantise(plain, pictures, path)


def write_float_proposer(net: nn.Module, path: Path) -> None:
    """`net` gives the raw maps of `Proposer`."""
    names = ["objectness", "box", "building", "window", "row"]
    free = {name: {0: "n", name_axes(name): "h", name_axes(name) + 1: "w"} for name in names}
    _export(
        ProposerAnswer(net).eval(),
        torch.zeros(1, 256, 256, 3, dtype=torch.uint8),
        path,
        ["pictures"],
        names,
        {"pictures": {0: "n", 1: "height", 2: "width"}, **free},
    )


def name_axes(name: str) -> int:
    """Which axis of an output is its height."""
    return 2 if name == "box" else 1


def write_namer(net: Namer, path: Path) -> None:
    names = ["kind", "colour", "box"]
    crops = torch.zeros(2, CROP_PX, CROP_PX, 3, dtype=torch.uint8)
    _export(net.eval(), crops, path, ["crops"], names, {n: {0: "m"} for n in ("crops", *names)})


def _export(
    net: nn.Module,
    example: torch.Tensor,
    path: Path,
    inputs: list[str],
    outputs: list[str],
    free: dict[str, dict[int, str]],
) -> None:
    part = path.with_suffix(".part")
    torch.onnx.export(
        net,
        (example,),
        str(part),
        input_names=inputs,
        output_names=outputs,
        dynamic_axes=free,
        opset_version=OPSET,
        dynamo=False,
    )
    part.rename(path)


def vocabulary_sha256(catalogue: Catalogue = CATALOGUE) -> str:
    return hashlib.sha256(catalogue.model_dump_json().encode()).hexdigest()


def plain_model(version: str, catalogue: Catalogue = CATALOGUE) -> Exported:
    """`model.json` before calibration."""
    return Exported(
        version=version,
        crop_px=CROP_PX,
        crop_context=CONTEXT,
        crop_min_px=LEAST_PX,
        kinds=tuple(kind_numbers(catalogue)),
        colours=tuple(colour_numbers(catalogue)),
        entries=catalogue.entries,
        proposing=Proposing(),
        calibration=PLAIN,
        vocabulary_sha256=vocabulary_sha256(catalogue),
    )


def write_model(model: Exported, folder: Path) -> None:
    (folder / MODEL_FILE).write_text(model.model_dump_json(indent=1) + "\n", encoding="utf-8")


def write_networks(nets: Path, folder: Path, pictures: Iterable[NDArray[np.uint8]]) -> None:
    """Both networks as their checkpoints have them, the proposer in integers with ranges from `pictures`."""
    folder.mkdir(parents=True, exist_ok=True)
    proposer = smoothed(nets / "proposer.pt", Proposer())
    namer = smoothed(nets / "namer.pt", Namer(len(kind_numbers()), len(colour_numbers())))
    assert isinstance(proposer, Proposer)
    assert isinstance(namer, Namer)
    write_proposer(proposer, folder / PROPOSER_FILE, pictures)
    write_namer(namer, folder / NAMER_FILE)

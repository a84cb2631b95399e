"""Training of the namer: class, colour and box of one crop."""

from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from training.crop_store import CropBatches, Crops
from training.nets import Namer
from training.prefetch import Prefetch
from training.training_loop import Plan, Trainer

CROP_PX, FIRST_PX = 64, 48
FIRST_SHARE = 0.65
"""Small crops teach most of it in half the time; the last part is at full size."""
BATCH = 32
PLAN = Plan(steps=12_000, rate=2e-3)
_SOFT = 0.05


def trainer(
    folder: Path,
    files: Sequence[Path],
    kinds: int,
    colours: int,
    plan: Plan = PLAN,
    seed: int = 1,
    batch: int = BATCH,
    device: str = "cpu",
    workers: int = 0,
) -> Trainer:
    """Goes on from the folder's checkpoint where there is one. `workers`: threads that make batches ahead."""
    torch.manual_seed(seed)
    crops = CropBatches(files, kinds, seed)

    def made(number: int) -> Crops:
        return crops.batch(number, batch, FIRST_PX if number < plan.steps * FIRST_SHARE else CROP_PX)

    coming = Prefetch(made, workers)

    def loss(net: nn.Module, number: int) -> tuple[Tensor, dict[str, float]]:
        rgb, kind, colour, box = (torch.from_numpy(part).to(device) for part in coming.get(number))
        kind_out, colour_out, box_out = net(rgb)
        return namer_loss(kind_out, colour_out, box_out, kind, colour, box, kinds)

    net = Namer(kinds, colours).to(device, memory_format=torch.channels_last)
    return Trainer("namer", folder, net, loss, plan)


def namer_loss(
    kind_out: Tensor, colour_out: Tensor, box_out: Tensor, kind: Tensor, colour: Tensor, box: Tensor, nothing: int
) -> tuple[Tensor, dict[str, float]]:
    """Cross-entropies, colour and box for things only. `nothing` is the class of a crop without a thing."""
    thing = kind != nothing
    kinds = nn.functional.cross_entropy(kind_out, kind, label_smoothing=_SOFT)
    colours = nn.functional.cross_entropy(colour_out, colour, reduction="none", label_smoothing=_SOFT)
    boxes = nn.functional.smooth_l1_loss(box_out, box, reduction="none", beta=0.05).mean(dim=1)
    count = thing.sum().clamp(min=1)
    colour_loss, box_loss = (colours * thing).sum() / count, (boxes * thing).sum() / count
    with torch.no_grad():
        named = kind_out.argmax(1) == kind
        painted = colour_out.argmax(1) == colour
        figures = {
            "kind": float(named.float().mean()),
            "colour": float((painted & thing).sum() / count),
            "both": float((named & painted & thing).sum() / count),
            "box": float(box_loss),
        }
    return kinds + 0.6 * colour_loss + 2.0 * box_loss, figures

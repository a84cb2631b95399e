"""Training of the proposer: where something stands, where the building is, its windows and floors."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from services.vlm_gateway.embedded.crops import proposals
from training.crop_store import Floats, Propose
from training.nets import STRIDE, Proposer, ProposerAnswer, distances_px
from training.pieces import Pieces
from training.prefetch import Prefetch
from training.shards import Picture
from training.training_loop import Plan, Trainer

BATCH = 4
PLAN = Plan(steps=6000, rate=1.5e-3)
_SHARPNESS = 2.0


def trainer(
    folder: Path,
    shards: Sequence[Path],
    plan: Plan = PLAN,
    seed: int = 1,
    batch: int = BATCH,
    device: str = "cpu",
    workers: int = 0,
) -> Trainer:
    """Goes on from the folder's checkpoint where there is one. `workers`: threads that make batches ahead."""
    torch.manual_seed(seed)
    pieces = Pieces(shards, seed)
    coming = Prefetch(lambda number: pieces.batch(number, batch), workers)

    def loss(net: nn.Module, number: int) -> tuple[Tensor, dict[str, float]]:
        rgb, core, care, inside, box, maps = (torch.from_numpy(part).to(device) for part in coming.get(number))
        return proposer_loss(net(rgb), core, care, inside, box, maps)

    return Trainer("proposer", folder, Proposer().to(device, memory_format=torch.channels_last), loss, plan)


def proposer_loss(
    out: Tensor, core: Tensor, care: Tensor, inside: Tensor, box: Tensor, maps: Tensor
) -> tuple[Tensor, dict[str, float]]:
    """out: raw maps (N, 8, h, w); the rest as in `pieces.Batch`. Focal loss on objectness, overlap on boxes."""
    sure = torch.sigmoid(out[:, 0])
    plain = nn.functional.binary_cross_entropy_with_logits(out[:, 0], core, reduction="none")
    things = core.sum().clamp(min=1.0)
    focus = torch.where(core > 0.5, 1 - sure, sure) ** _SHARPNESS
    objectness = (focus * plain * care).sum() / things
    overlap = overlaps(distances_px(out), box)
    boxes = ((1 - overlap) * inside).sum() / inside.sum().clamp(min=1.0)
    outlines = nn.functional.binary_cross_entropy_with_logits(out[:, 5:7], maps[:, :2])
    rows = nn.functional.binary_cross_entropy_with_logits(out[:, 7], maps[:, 2])
    with torch.no_grad():
        found = (sure * core).sum() / things
        tight = (overlap * core).sum() / things
    figures = {
        "things": float(objectness.detach()),
        "boxes": float(boxes.detach()),
        "outlines": float(outlines.detach()),
        "rows": float(rows.detach()),
        "found": float(found),
        "overlap": float(tight),
    }
    return objectness + boxes + outlines + 2 * rows, figures


def overlaps(ours: Tensor, box: Tensor) -> Tensor:
    """Generalised intersection over union of boxes given as distances to their sides, (N, 4, h, w) each."""
    across = torch.minimum(ours[:, 0], box[:, 0]) + torch.minimum(ours[:, 2], box[:, 2])
    down = torch.minimum(ours[:, 1], box[:, 1]) + torch.minimum(ours[:, 3], box[:, 3])
    both = across * down
    union = _area(ours) + _area(box) - both
    hull = (torch.maximum(ours[:, 0], box[:, 0]) + torch.maximum(ours[:, 2], box[:, 2])) * (
        torch.maximum(ours[:, 1], box[:, 1]) + torch.maximum(ours[:, 3], box[:, 3])
    )
    return both / union - (hull - union) / hull


def _area(box: Tensor) -> Tensor:
    return (box[:, 0] + box[:, 2]) * (box[:, 1] + box[:, 3])


def proposer_of(checkpoint: Path, threshold: float = 0.15, limit: int = 24) -> Propose:
    """Boxes as the trained proposer proposes them, doubtful ones included. Raises OSError without a checkpoint."""
    net = Proposer()
    net.load_state_dict(torch.load(checkpoint, weights_only=True, map_location="cpu")["smooth"])
    answer = ProposerAnswer(net.to(memory_format=torch.channels_last)).eval()

    def propose(rgb: Picture) -> Floats:
        with torch.no_grad():
            objectness, box, *_ = answer(torch.from_numpy(np.ascontiguousarray(rgb))[None])
        boxes, _ = proposals(
            objectness[0].numpy(), box[0].numpy(), stride=STRIDE, threshold=threshold, overlap=0.5, limit=limit
        )
        return boxes

    return propose

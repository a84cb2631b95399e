"""What a trained model looks like on disk: the agreement between `training`, which writes it, and the gateway.

The folder `weights/` beside this module holds three files.

`proposer.onnx` says where something stands, in whole pictures:
    in   pictures    uint8   (N, H, W, 3) RGB as decoded from the JPEG; H and W multiples of 32, trained at `picture_px`
    out  objectness  float32 (N, h, w)    probability that the cell lies inside the middle of a thing's box
         box         float32 (N, 4, h, w) pixels from the cell's centre to the box's left, top, right, bottom
         building    float32 (N, h, w)    probability that the cell shows the building ahead (things at its windows are
                                          part of it, neighbours behind it are not)
         window      float32 (N, h, w)    probability of a window's opening of that building
         row         float32 (N, h, w)    1 on the middle height of a floor's row of windows, falling to 0 within
                                          `ROW_SIGMA_PX` * 3; told across the wall between the windows as well
    h = H / stride, w = W / stride; the centre of cell (i, j) lies at x = (j + 0.5) * stride, y = (i + 0.5) * stride.

`namer.onnx` says what stands there, in crops cut by `crops.cut_crops` round the boxes of `crops.proposals`:
    in   crops   uint8   (M, crop_px, crop_px, 3) RGB
    out  kind    float32 (M, C + 1) logits of `kinds`, and of "nothing of the catalogue" at the end
         colour  float32 (M, K)     logits of `colours`
         box     float32 (M, 4)     the thing's own left, top, right, bottom in 0..1 of the crop (a tighter box)

`model.json` is an `Exported`. A sighting's raw score for a phrase that means `kinds` S and perhaps a colour c is
    score = sum over S of softmax(kind) * (softmax(colour)[c] if a colour was asked for else 1)
and its confidence is `confidence_of(score)`: the share of such sightings that were right on validation pictures
(seeds 90,000-99,999: never fitted to, never tested on).

Nothing here knows a scene: pixels and text only.
"""

from pathlib import Path
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from contracts.base import Unit, Wire
from contracts.sim import CatalogueEntry

FOLDER = Path(__file__).parent / "weights"
PROPOSER_FILE, NAMER_FILE, MODEL_FILE = "proposer.onnx", "namer.onnx", "model.json"
ROW_SIGMA_PX = 8.0


class Calibration(Wire):
    """A rising line through (score, probability) points; both ends are level."""

    score: tuple[Unit, ...] = Field(min_length=2, max_length=64)
    probability: tuple[Unit, ...] = Field(min_length=2, max_length=64)

    @model_validator(mode="after")
    def _rises(self) -> Self:
        pairs = len(self.score) == len(self.probability)
        if (
            not pairs
            or list(self.score) != sorted(set(self.score))
            or list(self.probability) != sorted(self.probability)
        ):
            raise ValueError("scores must rise, and probabilities must not fall, in pairs")
        return self


class Proposing(Wire):
    """How boxes are read off the proposer's maps: cells above `threshold`, boxes that overlap a better one by more
    than `overlap` (intersection over union) left out, at most `limit` a picture."""

    threshold: Unit = 0.25
    overlap: Unit = 0.5
    limit: int = Field(default=32, ge=1, le=400)


class Exported(Wire):
    """`model.json`. `claim` is the confidence from which a sighting is claimed at once, `candidate` the one from which
    it is worth another look from nearer. `row` and `building` are thresholds for those maps. `figures` say how the
    training went, for the model card; `vocabulary_sha256` is of the catalogue the model was trained on."""

    version: str
    picture_px: int = 800
    stride: int = 8
    crop_px: int = 64
    crop_context: float = 1.6
    crop_min_px: float = 24.0
    kinds: tuple[str, ...]
    colours: tuple[str, ...]
    entries: tuple[CatalogueEntry, ...]
    proposing: Proposing = Proposing()
    calibration: Calibration
    claim: Unit = 0.8
    candidate: Unit = 0.3
    row: Unit = 0.4
    building: Unit = 0.5
    vocabulary_sha256: str
    figures: dict[str, float] = {}

    @classmethod
    def load(cls, folder: Path = FOLDER) -> Self:
        """Raises OSError where the file is missing, ValueError where it isn't such a file."""
        return cls.model_validate_json((folder / MODEL_FILE).read_text(encoding="utf-8"))

    def confidence_of(self, score: float) -> float:
        """The calibrated probability that a sighting of that raw score is right."""
        return float(np.interp(score, self.calibration.score, self.calibration.probability))

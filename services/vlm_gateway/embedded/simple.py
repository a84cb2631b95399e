"""The first, simple model: four questions answered from pixels and text alone.

What it knows was counted and fitted from labelled pictures (`services.vlm_gateway.embedded.fit`) and lies beside this
module: `weights.npz` and `vocabulary.json`.
"""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Box, PointLabel
from services.vlm_gateway.embedded.bands import BANDS, column_bands, longest_run, peaks, row_bands, small
from services.vlm_gateway.embedded.colours import Coded, Patch, coded, likeness, patches
from services.vlm_gateway.embedded.describe import describe
from services.vlm_gateway.embedded.perceptron import Perceptron, sigmoid, softmax
from services.vlm_gateway.embedded.seen import BoxSeen, FloorsSeen, Found, MarkedPlace, Picture, Shot, Sighting
from services.vlm_gateway.embedded.simple_words import Vocabulary

FOLDER = Path(__file__).parent
ROW_APART = 7
BOX_LIKELY = 0.5
NOMINAL_PX = 800
WAY_FOR_WIDTH_M = 20.0
"""So many metres of way outweigh a whole picture's width towards the building."""


class SimpleModel:
    """Holds nothing but constants, so that threads may share it."""

    def __init__(self, folder: Path = FOLDER) -> None:
        arrays = dict(np.load(folder / "weights.npz"))
        self.version = str(arrays["version"])
        self._vocabulary = Vocabulary.load(folder / "vocabulary.json")
        self._rows = Perceptron.unpacked("rows", arrays)
        self._columns = Perceptron.unpacked("columns", arrays)
        self._classes = Perceptron.unpacked("classes", arrays)
        self._tables: NDArray[np.uint8] = arrays["tables"]
        self._sure = float(arrays["sure"])
        self._row_likely = float(arrays["row_likely"])

    @property
    def about(self) -> dict[str, object]:
        return {}

    def phrase_of(self, kind: str) -> str:
        """What people call things of a class. Raises KeyError."""
        return self._vocabulary.phrase_of[kind]

    def count_floors(self, shot: Shot) -> FloorsSeen:
        """The floors of the building ahead whose window row's middle lies in the picture."""
        rgb = shot.rgb()
        heat = sigmoid(self._rows.logits(row_bands(small(rgb))))[:, 0]
        found = peaks(heat, self._row_likely, ROW_APART)
        return FloorsSeen(len(found), tuple((i + 0.5) / BANDS for i in found))

    def building_box(self, shot: Shot) -> BoxSeen | None:
        """Where the building ahead is, null where there is none."""
        picture = small(shot.rgb())
        down = sigmoid(self._rows.logits(row_bands(picture)))[:, 1]
        across = sigmoid(self._columns.logits(column_bands(picture)))[:, 0]
        rows, columns = longest_run(down > BOX_LIKELY), longest_run(across > BOX_LIKELY)
        if rows is None or columns is None:
            return None
        box = Box(x_min=columns[0] / BANDS, y_min=rows[0] / BANDS, x_max=columns[1] / BANDS, y_max=rows[1] / BANDS)
        return BoxSeen(box, float(min(down[rows[0] : rows[1]].mean(), across[columns[0] : columns[1]].mean())))

    def find_object(self, views: Sequence[Shot], phrase: str) -> Found:
        """Where the thing of that name is seen. Raises OutOfVocabulary for a phrase that names nothing known."""
        wanted = self._vocabulary.wanted(phrase)
        kinds = [self._vocabulary.kinds.index(k) for k in wanted.kinds]
        possible = dict.fromkeys(c for k in wanted.kinds for c in self._vocabulary.colours_of[k])
        colours = [wanted.colour] if wanted.colour else list(possible)
        seen: list[Sighting] = []
        for i, shot in enumerate(views):
            picture = nominal(shot.rgb())
            code = coded(picture)
            for colour in colours:
                seen += self._look(i, picture, code, colour, kinds)
        return Found(tuple(sorted(seen, key=lambda s: -s.confidence)), self._sure)

    def choose_direction(self, shot: Shot, points: Sequence[MarkedPlace]) -> PointLabel:
        """Round a building on the right: far to the right, so that the way hugs the facade and turns with its corner,
        but not at the price of a short way. The distances that are asked with the points decide; the picture is that
        of the view which looks along the facade already."""
        return max(points, key=lambda p: p.distance_m / WAY_FOR_WIDTH_M + p.x).label

    def _look(self, view: int, picture: Picture, code: Coded, colour: str, kinds: list[int]) -> list[Sighting]:
        number = self._vocabulary.colours.index(colour)
        like = likeness(code, self._tables[number])
        found = patches(like)
        rows = describe(picture, like, found, number, len(self._vocabulary.colours))
        scores = softmax(self._classes.logits(rows))[:, kinds].sum(axis=1)
        return [
            Sighting(view, _box(p, picture.shape[0]), float(s))
            for p, s in zip(found, scores, strict=True)
            if s >= self._sure
        ]


def nominal(rgb: Picture) -> Picture:
    """The picture at the size at which patches were learnt."""
    if rgb.shape[:2] == (NOMINAL_PX, NOMINAL_PX):
        return rgb
    return np.asarray(cv2.resize(rgb, (NOMINAL_PX, NOMINAL_PX), interpolation=cv2.INTER_LINEAR), np.uint8)


def _box(p: Patch, side: int) -> Box:
    return Box(x_min=p.x / side, y_min=p.y / side, x_max=(p.x + p.width) / side, y_max=(p.y + p.height) / side)

"""The embedded model: four questions answered from pixels and text alone.

A picture goes through the proposer once and what stands there through the namer once; both are remembered, because
the next question about the same picture differs in its words only.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Box, PointLabel
from services.vlm_gateway.embedded.crops import crop_squares, cut_crops, proposals, suppressed
from services.vlm_gateway.embedded.exported import FOLDER, MODEL_FILE, NAMER_FILE, PROPOSER_FILE, Exported
from services.vlm_gateway.embedded.floors import box_of, rows_of
from services.vlm_gateway.embedded.memory import Recent
from services.vlm_gateway.embedded.network import Maps, Networks
from services.vlm_gateway.embedded.seen import BoxSeen, FloorsSeen, Found, MarkedPlace, Picture, Shot, Sighting
from services.vlm_gateway.embedded.words import OutOfVocabulary, Vocabulary, Wanted

Floats = NDArray[np.float32]
REMEMBERED = 40
"""Pictures: eight looks of five views, about a megabyte each look."""
STEP_PX = 32
TRAINED_FOCAL = 0.5
"""Focal length of the pictures trained on, in picture widths: 90 degrees across."""
MOST_SIDES = 3
"""Sides of a picture that is worked on, in trained ones: a long lens has detail that was never trained on."""
DARK = 80.0
"""Mean grey value, 0..255, up to which a picture is brightened: what lies in the dark has contours as well. Of 129
square pictures of 43 validation streets 117 are counted exactly with it, and 110 without."""
SMALLEST_BOX = 0.002
OVERLAP = 0.5
WAY_FOR_WIDTH_M = 20.0
"""So many metres of way outweigh a whole picture's width towards the building."""
CLEARLY = 0.15


class Sheet(NamedTuple):
    """A picture as the networks take it: `pixels` (H, W, 3), H and W multiples of STEP_PX, of which the upper left
    `height` x `width` is the picture, the rest padding."""

    pixels: Picture
    height: int
    width: int


class Names(NamedTuple):
    """What stands in the proposals: shares of kinds (P, C + 1) and of colours (P, K), and the tighter boxes (P, 4) in
    pixels of the sheet."""

    kind: Floats
    colour: Floats
    boxes: Floats


class Seen(NamedTuple):
    """One picture through the proposer (maps of (h, w), boxes (P, 4) in pixels of the sheet), and through the namer
    where an object was asked for."""

    height: int
    width: int
    building: Floats
    row: Floats
    boxes: Floats
    names: Names | None


class EmbeddedModel:
    """May be used from several threads at once."""

    def __init__(self, folder: Path = FOLDER, *, threads: int = 1, remembered: int = REMEMBERED) -> None:
        """Raises OSError where the trained files are missing, ValueError where they aren't such files."""
        self.exported = Exported.load(folder)
        self.version = self.exported.version
        self._networks = Networks(folder, threads=threads)
        names = {e.kind: (e.phrase, *e.synonyms) for e in self.exported.entries}
        self._vocabulary = Vocabulary(names, self.exported.colours)
        self._recent: Recent[Seen] = Recent(remembered)
        self._bytes = sum((folder / name).stat().st_size for name in (PROPOSER_FILE, NAMER_FILE, MODEL_FILE))

    @property
    def about(self) -> dict[str, object]:
        """Size, thresholds and the figures of the training."""
        exported = self.exported
        return {
            "megabytes": round(self._bytes / 1e6, 3),
            "kinds": len(exported.kinds),
            "colours": len(exported.colours),
            "claim": exported.claim,
            "candidate": exported.candidate,
            "figures": dict(exported.figures),
        }

    def out_of_vocabulary(self, phrase: str) -> str | None:
        """Why the phrase names nothing that the model was trained on; None where it names something."""
        try:
            self._vocabulary.wanted(phrase)
        except OutOfVocabulary as error:
            return str(error)
        return None

    def count_floors(self, shot: Shot) -> FloorsSeen:
        """The floors of the building ahead whose window row's middle lies in the picture."""
        seen = self._seen([shot], named=False)[0]
        stride = self.exported.stride
        found = rows_of(seen.row, seen.building, likely=self.exported.row, inside=self.exported.building)
        rows = tuple(r.at * stride / seen.height for r in found if r.at * stride < seen.height)
        return FloorsSeen(len(rows), rows)

    def building_box(self, shot: Shot) -> BoxSeen | None:
        """Where the building ahead is, null where there is none."""
        found = box_of(self._seen([shot], named=False)[0].building, inside=self.exported.building)
        return None if found is None else BoxSeen(*found)

    def find_object(self, views: Sequence[Shot], phrase: str) -> Found:
        """Where the thing of that name is seen: all that is worth another look. Raises OutOfVocabulary for a phrase
        that names nothing the model was trained on."""
        wanted = self._vocabulary.wanted(phrase)
        sightings = [
            sighting
            for index, seen in enumerate(self._seen(views, named=True))
            for sighting in self._sightings(index, seen, wanted)
        ]
        return Found(tuple(sorted(sightings, key=lambda s: -s.confidence)), self.exported.claim)

    def choose_direction(self, shot: Shot, points: Sequence[MarkedPlace]) -> PointLabel:
        """Round a building: far to its side of the picture, so that the way hugs the facade and turns with its corner,
        but not at the price of a short way. Where the picture doesn't say which side that is, it is the right."""
        building = self._seen([shot], named=False)[0].building
        half = building.shape[1] // 2
        mirrored = float(building[:, :half].mean() - building[:, half:].mean()) > CLEARLY
        return max(points, key=lambda p: p.distance_m / WAY_FOR_WIDTH_M + (1 - p.x if mirrored else p.x)).label

    def _seen(self, shots: Sequence[Shot], *, named: bool) -> list[Seen]:
        """Each picture through what it has not been through yet, all of them in one batch."""
        known = {shot.key: self._recent.get(shot.key) for shot in shots}
        fresh = {shot.key: shot for shot in shots if (s := known[shot.key]) is None or (named and s.names is None)}
        sheets = {key: self._sheet(shot) for key, shot in fresh.items()}
        unseen = [key for key in fresh if known[key] is None]
        for shape in {sheets[key].pixels.shape for key in unseen}:
            alike = [key for key in unseen if sheets[key].pixels.shape == shape]
            maps = self._networks.propose(np.stack([sheets[key].pixels for key in alike]))
            for at, key in enumerate(alike):
                known[key] = self._proposed(sheets[key], maps, at)
        seen = {key: value for key, value in known.items() if value is not None}
        if named and fresh:
            names = self._names([(sheets[key].pixels, seen[key].boxes) for key in fresh])
            seen |= {key: seen[key]._replace(names=n) for key, n in zip(fresh, names, strict=True)}
        for key in fresh:
            self._recent.put(key, seen[key])
        return [seen[shot.key] for shot in shots]

    def _sheet(self, shot: Shot) -> Sheet:
        """The picture with as many pixels a degree as those that the model was trained on; one of an unknown camera as
        if it were of theirs."""
        rgb, trained_px = brightened(shot.rgb()), self.exported.picture_px
        if shot.focal_px is None:
            return sheet(rgb, trained_px)
        side_px = round(max(rgb.shape[:2]) * trained_px * TRAINED_FOCAL / shot.focal_px)
        return sheet(rgb, min(max(side_px, STEP_PX), MOST_SIDES * trained_px))

    def _proposed(self, picture: Sheet, maps: Maps, at: int) -> Seen:
        say = self.exported.proposing
        stride = self.exported.stride
        boxes, _ = proposals(
            maps.objectness[at],
            maps.box[at],
            stride=stride,
            threshold=say.threshold,
            overlap=say.overlap,
            limit=say.limit,
        )
        down, across = -(-picture.height // stride), -(-picture.width // stride)
        building, row = maps.building[at, :down, :across].copy(), maps.row[at, :down, :across].copy()
        return Seen(picture.height, picture.width, building, row, boxes, None)

    def _names(self, pictures: Sequence[tuple[Picture, Floats]]) -> list[Names]:
        """All crops of all pictures in one batch."""
        exported = self.exported
        squares = [crop_squares(b, context=exported.crop_context, min_px=exported.crop_min_px) for _, b in pictures]
        crops = [cut_crops(rgb, s, exported.crop_px) for (rgb, _), s in zip(pictures, squares, strict=True)]
        whole = np.concatenate(crops)
        if not len(whole):
            none = np.zeros((0, len(exported.kinds) + 1), np.float32)
            return [Names(none, np.zeros((0, len(exported.colours)), np.float32), b) for _, b in pictures]
        said = self._networks.name(whole)
        kind, colour = softmax(said.kind), softmax(said.colour)
        names = []
        first = 0
        for (_, boxes), cut in zip(pictures, squares, strict=True):
            part = slice(first, first + len(cut))
            names.append(Names(kind[part], colour[part], tightened(boxes, cut, said.box[part])))
            first += len(cut)
        return names

    def _sightings(self, view: int, seen: Seen, wanted: Wanted) -> list[Sighting]:
        if seen.names is None:
            return []
        exported = self.exported
        score = seen.names.kind[:, [exported.kinds.index(k) for k in wanted.kinds]].sum(axis=1)
        if wanted.colour is not None:
            score = score * seen.names.colour[:, exported.colours.index(wanted.colour)]
        order = np.argsort(-score, kind="stable")
        kept = [int(order[i]) for i in suppressed(seen.names.boxes[order], OVERLAP, len(order))]
        sightings = []
        for i in kept:
            confidence = exported.confidence_of(float(score[i]))
            box = _shared(seen.names.boxes[i], seen)
            if confidence >= exported.candidate and box is not None:
                sightings.append(Sighting(view, box, confidence))
        return sightings


def sheet(rgb: Picture, side_px: int) -> Sheet:
    """The picture with its longer side brought to `side_px`, padded by repeating its border."""
    height, width = rgb.shape[:2]
    if max(height, width) != side_px:
        scale = side_px / max(height, width)
        height, width = max(1, round(height * scale)), max(1, round(width * scale))
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        rgb = np.asarray(cv2.resize(rgb, (width, height), interpolation=how), np.uint8)
    down, across = -height % STEP_PX, -width % STEP_PX
    if down or across:
        rgb = np.asarray(cv2.copyMakeBorder(rgb, 0, down, 0, across, cv2.BORDER_REPLICATE), np.uint8)
    return Sheet(rgb, height, width)


def brightened(rgb: Picture) -> Picture:
    """A dark picture by the power of its grey values that takes their mean to DARK; others, and black ones, as they
    are."""
    mean = float(rgb.mean())
    if not 1.0 <= mean < DARK:
        return rgb
    power = math.log(DARK / 255.0) / math.log(mean / 255.0)
    values = np.rint(255.0 * (np.arange(256) / 255.0) ** power).astype(np.uint8)
    return np.asarray(cv2.LUT(rgb, values), np.uint8)


def softmax(logits: Floats) -> Floats:
    """(N, C) rows that sum to one."""
    raised = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(raised / raised.sum(axis=1, keepdims=True), np.float32)


def tightened(boxes: Floats, squares: Floats, inner: Floats) -> Floats:
    """(P, 4) pixels: the namer's boxes, given in 0..1 of their crops, in the picture; the proposal's own where the
    namer's has no size."""
    side = squares[:, 2:3]
    corner = squares[:, :2] - side / 2
    tight = np.concatenate([corner + inner[:, :2] * side, corner + inner[:, 2:] * side], axis=1)
    whole = (tight[:, 2] - tight[:, 0] >= 2.0) & (tight[:, 3] - tight[:, 1] >= 2.0)
    return np.where(whole[:, None], tight, boxes).astype(np.float32)


def _shared(box: Floats, seen: Seen) -> Box | None:
    """Pixels to shares of the picture, clipped; null where nothing of it is left."""
    edges = box / np.array([seen.width, seen.height, seen.width, seen.height], np.float32)
    x_min, y_min, x_max, y_max = (float(min(1.0, max(0.0, e))) for e in edges)
    if x_max - x_min < SMALLEST_BOX or y_max - y_min < SMALLEST_BOX:
        return None
    return Box(x_min=x_min, y_min=y_min, x_max=x_max, y_max=y_max)

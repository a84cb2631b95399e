"""What the networks are fitted to: pieces with the maps they should draw, crops with the box they should find."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from services.vlm_gateway.embedded.crops import proposals
from training.calibrate import Sighting, calibrated, claim_score, outcome, rising, row_threshold
from training.crop_store import CropBatches, Crops, backgrounds, collect, crops_of, moved, overlap_matrix
from training.judge import SeenPicture
from training.labels import STRIDE, Labels, Thing
from training.pieces import PIECE_PX, Pieces, piece, targets
from training.prefetch import Prefetch
from training.shards import THING, write

CELLS = PIECE_PX // STRIDE
GREEN = (20, 200, 40)


def picture_with(box: tuple[int, int, int, int]) -> np.ndarray:
    rgb = np.full((800, 800, 3), 120, np.uint8)
    left, top, right, bottom = box
    rgb[top:bottom, left:right] = GREEN
    return rgb


def labels_of(box: tuple[float, float, float, float], kind: int = 3, share: float = 1.0) -> Labels:
    pixels = int((box[2] - box[0]) * (box[3] - box[1]))
    empty = np.zeros((100, 100), np.uint8)
    building = empty.copy()
    building[20:80, 20:80] = 255
    return Labels((Thing(kind, 1, box, pixels, share, 6.0, False),), building, empty, empty)


def shard_with(folder: Path, seed: int = 1) -> Path:
    box = (300, 260, 380, 330)
    jpeg = cv2.imencode(".jpg", picture_with(box)[:, :, ::-1])[1].tobytes()
    path = folder / f"street-{seed:07d}.npz"
    write(path, seed, [jpeg], [labels_of(tuple(map(float, box)))], [False], crowded=True)
    return path


def test_the_maps_that_a_perfect_proposer_draws_give_the_boxes_back() -> None:
    boxes = np.array([[40, 60, 90, 120], [200, 200, 216, 230], [230, 90, 380, 180]], np.float32)
    core, _, _, box = targets(boxes, np.ones(3, np.bool_), CELLS)
    found, scores = proposals(core, box, stride=STRIDE, threshold=0.5, overlap=0.5, limit=10)
    assert len(found) == 3
    assert (scores == 1).all()
    assert overlap_matrix(boxes, found).max(axis=1) == pytest.approx([1, 1, 1], abs=1e-5)


def test_the_smaller_of_two_things_that_overlap_keeps_its_middle() -> None:
    boxes = np.array([[40, 40, 200, 200], [100, 100, 140, 140]], np.float32)
    core, _, _, box = targets(boxes, np.ones(2, np.bool_), CELLS)
    assert core[15, 15] == 1
    assert box[:, 15, 15].tolist() == [24, 24, 16, 16]


def test_what_is_hardly_seen_is_neither_asked_for_nor_forbidden() -> None:
    boxes = np.array([[40, 40, 120, 120]], np.float32)
    core, care, _, _ = targets(boxes, np.zeros(1, np.bool_), CELLS)
    assert core.sum() == 0
    assert care[10, 10] == 0
    assert care[30, 30] == 1


def test_pieces_keep_picture_and_boxes_together() -> None:
    box = (300, 260, 380, 330)
    things = np.array([(0, 3, 1, False, box, 5600, 1.0, 6.0)], THING)
    maps = np.zeros((3, 100, 100), np.float32)
    checked = 0
    for seed in range(20):
        cut = piece(picture_with(box), maps, things, np.random.default_rng(seed))
        green = (cut.rgb[:, :, 1].astype(int) - cut.rgb[:, :, 0]) > 60
        rows, columns = np.nonzero(cut.core)
        for row, column in zip(rows, columns, strict=True):
            x, y = (column + 0.5) * STRIDE, (row + 0.5) * STRIDE
            left, top, right, bottom = cut.box[:, row, column]
            edges = np.nonzero(green)
            expected = [edges[1].min(), edges[0].min(), edges[1].max() + 1, edges[0].max() + 1]
            assert [x - left, y - top, x + right, y + bottom] == pytest.approx(expected, abs=3.5)
            checked += 1
    assert checked > 50


def test_the_same_number_gives_the_same_batch(tmp_path: Path) -> None:
    path = shard_with(tmp_path)
    first, again = (Pieces([path], 7).batch(5, 3) for _ in range(2))
    assert all((a == b).all() for a, b in zip(first, again, strict=True))
    assert (Pieces([path], 7).batch(6, 3).rgb != first.rgb).any()


def test_without_shards_one_is_told_what_to_do() -> None:
    with pytest.raises(ValueError, match="training render"):
        Pieces([], 1)


def test_crops_show_the_thing_in_its_box_and_backgrounds_show_none(tmp_path: Path) -> None:
    (file,) = collect([shard_with(tmp_path)], tmp_path / "crops", 10, context=1.6, min_px=24.0)
    crops = Crops(**dict(np.load(file)))
    assert list(crops.kind).count(3) == 1
    assert set(crops.kind.tolist()) <= {3, 10}
    at = list(crops.kind).index(3)
    for seed in range(10):
        rgb, box = moved(crops.rgb[at], crops.box[at], 64, np.random.default_rng(seed))
        rows, columns = np.nonzero((rgb[:, :, 1].astype(int) - rgb[:, :, 0]) > 60)
        seen = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        assert [v / 64 for v in seen] == pytest.approx(box.tolist(), abs=0.06)
    for k in np.flatnonzero(crops.kind == 10):
        assert (np.abs(crops.rgb[k].astype(int) - 120) < 12).mean() > 0.9


def test_proposals_are_matched_with_what_they_propose(tmp_path: Path) -> None:
    from training.shards import read

    shard = read(shard_with(tmp_path))

    def propose(rgb: np.ndarray) -> np.ndarray:
        return np.array([[304, 255, 390, 330], [600, 600, 640, 650], [340, 290, 420, 360]], np.float32)

    crops = crops_of(shard, 10, context=1.6, min_px=24.0, propose=propose)
    # the true box and the near one; the half-right one is neither the thing nor nothing
    assert list(crops.kind).count(3) == 2
    assert list(crops.kind).count(10) >= 1


def test_batches_hold_as_much_nothing_as_was_asked_for(tmp_path: Path) -> None:
    file = collect([shard_with(tmp_path, s) for s in (1, 2)], tmp_path / "crops", 10, context=1.6, min_px=24.0)
    drawn = CropBatches(file, 10, seed=1, nothing=0.3).batch(0, 400, 48)
    assert drawn.rgb.shape == (400, 48, 48, 3)
    assert (drawn.kind == 10).mean() == pytest.approx(0.3, abs=0.08)


def test_backgrounds_lie_apart_from_things() -> None:
    building = np.full((100, 100), 255, np.uint8)
    boxes = np.array([[100, 100, 700, 700]], np.float32)
    for seed in range(20):
        for box in backgrounds(building, boxes, np.random.default_rng(seed)):
            assert overlap_matrix(box[None], boxes).max() < 0.1


def test_rising_is_the_nearest_sequence_that_never_falls() -> None:
    assert rising(np.array([0.0, 1.0, 0.0, 1.0, 1.0])).tolist() == [0.0, 0.5, 0.5, 1.0, 1.0]
    assert (np.diff(rising(np.random.default_rng(0).random(200))) >= 0).all()


def honest(count: int = 6000) -> list[Sighting]:
    """Sightings whose score is twice too sure: right in half of the share it says."""
    rng = np.random.default_rng(3)
    scores = rng.random(count)
    return [Sighting((k // 10, 0, 0), float(s), bool(rng.random() < s / 2), True) for k, s in enumerate(scores)]


def test_confidence_is_the_share_of_right_sightings() -> None:
    line = calibrated(honest())
    for score in (0.3, 0.5, 0.8):
        assert np.interp(score, line.score, line.probability) == pytest.approx(score / 2, abs=0.06)


def test_the_claim_threshold_is_the_lowest_without_wrong_claims_where_it_costs_no_right_ones() -> None:
    rng = np.random.default_rng(4)
    found = [
        Sighting((k // 10, 0, 0), float(s), bool(s > 0.7 or rng.random() < 0.5), True)
        for k, s in enumerate(rng.random(4000))
    ]
    score = claim_score(found)
    assert 0.68 < score < 0.75
    assert outcome(found, score).wrong <= 0.01
    assert outcome(found, 0.1).wrong > 0.2


def square_look(rows_true: int, *strengths: float) -> SeenPicture:
    profile = np.zeros(100, np.float32)
    profile[10 : 10 + 12 * len(strengths) : 12] = strengths
    none = np.zeros((0, 4), np.float32)
    return SeenPicture(1, True, np.zeros(0, THING), none, none, none, none, none, none, profile, rows_true, 1.0)


def test_rows_count_from_where_most_pictures_are_counted_rightly() -> None:
    looks = [square_look(3, 0.4, 0.25, 0.5), square_look(2, 0.3, 0.3, 0.12), square_look(1, 0.13, 0.6)]
    assert 0.13 < row_threshold(looks) <= 0.25
    with pytest.raises(ValueError, match="no square pictures"):
        row_threshold([])


@pytest.mark.parametrize("workers", [0, 3])
def test_batches_made_ahead_come_in_their_order_and_skips_are_followed(workers: int) -> None:
    batches = Prefetch(lambda number: number * 10, workers)
    assert [batches.get(n) for n in (0, 1, 2, 3, 9, 10, 4)] == [0, 10, 20, 30, 90, 100, 40]

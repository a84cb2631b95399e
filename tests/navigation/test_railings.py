"""Where a railing may stand that depth has missed."""

import numpy as np

from navigation.camera import Pose
from navigation.railings import RAILING_M, carriers, railings_on

HERE = Pose(0.0, 0.0, 6.0, 0.0)
NOISE = np.random.default_rng(3)


def _plane(height_m: float, fall: float, *, noise_m: float = 0.02) -> np.ndarray:
    """Points on 1.5 m by 3 m, 4 m ahead, that fall by so much a metre towards the drone."""
    x, y = NOISE.uniform(4.0, 5.5, 400), NOISE.uniform(-1.5, 1.5, 400)
    z = height_m + fall * (x - 4.0) + NOISE.normal(0.0, noise_m, 400)
    return np.stack((x, y, z), axis=1).astype(np.float32)


def _wall() -> np.ndarray:
    y, z = NOISE.uniform(-3.0, 3.0, 2000), NOISE.uniform(0.0, 9.0, 2000)
    return np.stack((5.5 + NOISE.normal(0.0, 0.03, 2000), y, z), axis=1).astype(np.float32)


def _posts() -> np.ndarray:
    """What depth shows of a railing about that plane: here and there a piece."""
    y = NOISE.uniform(-1.5, 1.5, 12)
    return np.stack((np.full(12, 4.05), y, 3.2 + NOISE.uniform(0.3, 0.9, 12)), axis=1).astype(np.float32)


def test_a_slab_with_something_on_it_carries_one_up_to_its_edge() -> None:
    slab = carriers(np.concatenate([_plane(3.2, 0.0), _posts(), _wall()]), HERE)
    assert slab[:, 0].min() < 4.4
    assert slab[:, 1].min() < -1.2 < 1.2 < slab[:, 1].max()
    rails = railings_on(slab)
    assert len(rails) == 2 * len(slab)
    np.testing.assert_allclose(rails[-len(slab) :, 2], slab[:, 2] + RAILING_M, atol=1e-5)


def test_what_depth_made_of_the_bars_does_not_hide_the_slab() -> None:
    bars = _plane(3.7, 0.0, noise_m=0.3)[:40]
    assert len(carriers(np.concatenate([_plane(3.2, 0.0), bars, _wall()]), HERE)) > 40


def test_what_is_level_and_bare_carries_none() -> None:
    assert len(carriers(np.concatenate([_plane(3.2, 0.0), _wall()]), HERE)) == 0


def test_a_wall_a_steep_roof_and_what_is_no_higher_than_a_car_carry_none() -> None:
    assert len(carriers(_wall(), HERE)) == 0
    assert len(carriers(_plane(3.2, 0.6), HERE)) <= 2
    assert len(carriers(_plane(1.6, 0.0), HERE)) == 0
    assert len(carriers(np.zeros((0, 3), np.float32), HERE)) == 0

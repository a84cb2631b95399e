"""The statistics of a LeRobot dataset: of all episodes together they are those of all their frames."""

import numpy as np
import pytest

from evaluation.export.lerobot_statistics import of_all, of_depth, of_pictures, of_vectors


def test_statistics_of_all_episodes_are_those_of_their_frames_together() -> None:
    chance = np.random.default_rng(3)
    episodes = [chance.normal(n, 1 + n, (5 + 7 * n, 3)).astype(np.float32) for n in range(4)]
    together, apart = of_vectors(np.concatenate(episodes)), of_all([of_vectors(episode) for episode in episodes])
    for name in ("min", "max", "mean", "std", "count"):
        assert apart[name] == pytest.approx(together[name], rel=1e-6), name


def test_depth_counts_what_was_measured_and_not_what_is_unknown_or_out_of_reach() -> None:
    units = np.full((40, 40), 65535, np.uint16)
    units[:10], units[10:20], units[20:30] = 0, 1000, 3000
    found = of_depth([units], 0.002)
    assert [float(found[name].item()) for name in ("min", "max", "mean")] == pytest.approx([2.0, 6.0, 4.0])
    assert found["mean"].shape == (1, 1, 1)
    nothing = of_depth([np.zeros((40, 40), np.uint16)], 0.002)
    assert float(nothing["max"].item()) == 0.0


def test_pictures_are_told_by_channel_in_shares_of_full_brightness() -> None:
    picture = np.zeros((300, 200, 3), np.uint8)
    picture[:, :, 1] = 255
    found = of_pictures([picture, picture])
    assert found["mean"].reshape(-1) == pytest.approx([0.0, 1.0, 0.0])
    assert found["count"].tolist() == [2.0]

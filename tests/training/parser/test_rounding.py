"""The table of words in four bits."""

from pathlib import Path

import numpy as np

from services.llm_parser.reader.words import GROUP, Words
from training.parser.rounding import rounded


def table() -> np.ndarray:
    return np.random.default_rng(0).normal(0.0, 0.05, (50, 3 * GROUP)).astype(np.float32)


def test_four_bits_keep_a_word_to_a_tenth() -> None:
    exact = table()
    words = rounded(exact)
    assert words.packed.nbytes == exact.size // 2
    assert np.linalg.norm(words.all() - exact) < 0.12 * np.linalg.norm(exact)


def test_rounding_what_is_rounded_changes_nothing() -> None:
    once = rounded(table()).all()
    assert np.allclose(rounded(once).all(), once, atol=1e-4)


def test_a_word_of_zeros_stays_zero() -> None:
    assert not rounded(np.zeros((2, GROUP), np.float32)).all().any()


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    words = rounded(table())
    words.save(tmp_path / "words.npz")
    ids = np.array([3, 0, 3, 49])
    assert np.array_equal(Words.load(tmp_path / "words.npz").rows(ids), words.all()[ids])

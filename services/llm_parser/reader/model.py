"""The shipped network: tokens in, scores out, by ONNX Runtime on one thread; nothing is fetched.

Its folder holds `reader.onnx.zst` (the encoders in eight-bit integers, per channel, and the heads), `words.npz` (the
word embeddings in four bits: services.llm_parser.reader.words), `spelling.txt.zst` (known words, and how often
customers write them), `tokenizer.json` and `about.json`.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnxruntime
import zstandard
from numpy.typing import NDArray
from pydantic import BaseModel
from tokenizers import Tokenizer

from services.llm_parser.reader.decode import Scores, Tokens
from services.llm_parser.reader.mentions import Mention
from services.llm_parser.reader.spelling import Spelling
from services.llm_parser.reader.words import Words

NETWORK, SPELLING, ABOUT = "reader.onnx.zst", "spelling.txt.zst", "about.json"
FILES = (NETWORK, "words.npz", SPELLING, "tokenizer.json", ABOUT)
MOST_TOKENS = 384
"""A longer request is read as far as this, and said to be too long."""


class Calibration(BaseModel):
    """From the network's probability p to the share of such answers that are right: the logistic function of
    `slope` logit(p) + `offset`, fitted on authors that were left out (Platt)."""

    slope: float = 1.0
    offset: float = 0.0

    def probability(self, p: float) -> float:
        p = min(max(p, 1e-6), 1.0 - 1e-6)
        return 1.0 / (1.0 + math.exp(-self.slope * math.log(p / (1.0 - p)) - self.offset))


class Calibrations(BaseModel):
    """Of each field."""

    floor: Calibration = Calibration()
    object: Calibration = Calibration()


class Thresholds(BaseModel):
    """From which calibrated probability a field is answered."""

    floor: float
    object: float


class About(BaseModel):
    """What the training wrote down of a network, as far as reading with it needs that."""

    calibration: Calibrations = Calibrations()
    thresholds: Thresholds


class Encoded(NamedTuple):
    """A request's tokens; `cut`: its end was not read. `averaging`: (M, T) rows that average a mention's tokens."""

    ids: NDArray[np.int64]
    tokens: Tokens
    averaging: NDArray[np.float32]
    cut: bool


def encode(tokenizer: Tokenizer, text: str, mentions: tuple[Mention, ...], most: int = MOST_TOKENS) -> Encoded:
    """`mentions` that lie behind what is read average to nothing."""
    encoding = tokenizer.encode(text)
    ids, offsets = list(encoding.ids), list(encoding.offsets)
    cut = len(ids) > most
    if cut:
        ids, offsets = [*ids[: most - 1], ids[-1]], [*offsets[: most - 1], (0, 0)]
    averaging = np.zeros((len(mentions), len(ids)), np.float32)
    for at, mention in enumerate(mentions):
        covered = [i for i, (s, e) in enumerate(offsets) if s < mention.end and mention.start < e]
        if covered:
            averaging[at, covered] = 1.0 / len(covered)
    return Encoded(np.array(ids, np.int64), Tokens(text, offsets), averaging, cut)


class ReaderModel:
    """Thread-safe: a session may be run by several threads."""

    def __init__(self, folder: Path) -> None:
        """Raises FileNotFoundError where the weights are not there."""
        missing = [name for name in FILES if not (folder / name).is_file()]
        if missing:
            raise FileNotFoundError(f"the reader's weights are not complete: {', '.join(missing)} missing in {folder}")
        self.about = About.model_validate_json((folder / ABOUT).read_bytes())
        self.tokenizer = Tokenizer.from_file(str(folder / "tokenizer.json"))
        self.tokenizer.no_padding()
        self.tokenizer.no_truncation()
        self.spelling = Spelling(_counts(folder / SPELLING), self.tokenizer.get_vocab())
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session = onnxruntime.InferenceSession(
            zstandard.decompress((folder / NETWORK).read_bytes()),
            options,
            providers=["CPUExecutionProvider"],
        )
        self._words = Words.load(folder / "words.npz")

    def scores(self, encoded: Encoded) -> Scores:
        embedded = self._words.rows(encoded.ids)
        mentions = encoded.averaging if len(encoded.averaging) else np.zeros((1, len(encoded.ids)), np.float32)
        found = self._session.run(None, {"embedded": embedded[None], "averaging": mentions[None]})
        return Scores(*(part[0] for part in found))


def _counts(path: Path) -> dict[str, int]:
    """Lines of a word and, behind a space, how often customers write it."""
    lines = zstandard.decompress(path.read_bytes()).decode().splitlines()
    return {word: int(count or 0) for word, _, count in (line.partition(" ") for line in lines)}

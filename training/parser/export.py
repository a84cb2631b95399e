"""The fitted reader as the service loads it: ONNX with integer weights, compressed, and the words' table."""

import json
import shutil
import warnings
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
import zstandard
from onnxruntime.quantization import QuantType, quantize_dynamic
from torch import Tensor, nn

from services.llm_parser.reader.model import ABOUT, NETWORK
from training.parser.bases import MPNET, TOKENIZER
from training.parser.net import Layer, Reader
from training.parser.rounding import rounded

STEPS = 31
"""A layer's weights take so many steps to either side of 0, an output's by its largest: held in eight bits, they are
compressed to less than five."""


SHARES = (0.65, 0.35)
"""Of MPNet and MiniLM in what is said, chosen on left-out authors."""


class Exported(nn.Module):
    """Readers of the same words from the word embeddings on, which stand side by side, for one request without padding.
    What they say is averaged by `shares`: of softmaxes, that is the weighted geometric mean."""

    def __init__(self, nets: Sequence[Reader], shares: Sequence[float]) -> None:
        super().__init__()
        self.nets = nn.ModuleList(nets)
        self.shares = shares

    def forward(self, embedded: Tensor, averaging: Tensor) -> tuple[Tensor, ...]:
        said, at = [], 0
        for net, share in zip(self.nets, self.shares, strict=True):
            end = at + net.encoder.hidden
            said.append([share * part for part in _scores(net, embedded[..., at:end], averaging)])
            at = end
        return tuple(torch.stack(parts).sum(0) for parts in zip(*said, strict=True))


def _scores(net: Any, embedded: Tensor, averaging: Tensor) -> tuple[Tensor, ...]:
    mask = torch.ones_like(embedded[..., 0])
    x = net.encoder.encoded(embedded, mask)
    mentions, first = net.mentions(x, averaging), x[:, 0]
    return (
        net.whole(x, mask),
        net.one_scores(mentions, first),
        net.pair_scores(mentions, first),
        net.object(x),
        net.anchor(x),
        net.tagger(x)[..., 0],
    )


def _coarse(net: Reader) -> Reader:
    """A copy whose layers' weights take STEPS steps to either side."""
    net = deepcopy(net).eval()
    for layer in net.encoder.layers:
        assert isinstance(layer, Layer)
        for part in (layer.qkv, layer.out, layer.up, layer.down):
            weight = part.weight.data
            step = weight.abs().amax(1, keepdim=True).clamp(min=1e-9) / STEPS
            weight.copy_((weight / step).round() * step)
    return net


NAMES = ("whole", "ones", "pairs", "objects", "anchors", "tags")


def export(nets: Sequence[Reader], shares: Sequence[float], home: Path, out: Path, about: dict[str, Any]) -> None:
    """Writes the files that services.llm_parser.reader.model reads, but for the words of its spelling."""
    exported = Exported([_coarse(net) for net in nets], shares).eval()
    words = np.concatenate([net.encoder.word.weight.detach().numpy() for net in nets], axis=1)
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        plain, small = Path(folder) / "plain.onnx", Path(folder) / "small.onnx"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the tracer warns of sizes that are the same for every request
            torch.onnx.export(
                exported,
                (torch.zeros(1, 12, words.shape[1]), torch.zeros(1, 3, 12)),
                str(plain),
                input_names=["embedded", "averaging"],
                output_names=list(NAMES),
                dynamic_axes={"embedded": {1: "tokens"}, "averaging": {1: "mentions", 2: "tokens"}},
                opset_version=17,
                dynamo=False,
            )
        quantize_dynamic(
            str(plain),
            str(small),
            per_channel=True,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=["MatMul"],
        )
        (out / NETWORK).write_bytes(zstandard.compress(small.read_bytes(), 12))
    rounded(words).save(out / "words.npz")
    shutil.copy(home / MPNET.name / TOKENIZER, out / "tokenizer.json")
    (out / ABOUT).write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")

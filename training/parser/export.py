"""The fitted reader as the service loads it: ONNX with eight-bit integers per channel, and the word table."""

import json
import shutil
import warnings
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from onnxruntime.quantization import QuantType, quantize_dynamic
from torch import Tensor, nn

from training.parser.net import Reader


class Exported(nn.Module):
    """Readers of the same words from the word embeddings on, for one request without padding. What they say is
    averaged: of softmaxes, that is the geometric mean."""

    def __init__(self, nets: Sequence[Reader]) -> None:
        super().__init__()
        self.nets = nn.ModuleList(nets)

    def forward(self, embedded: Tensor, averaging: Tensor) -> tuple[Tensor, ...]:
        said = [_scores(net, embedded, averaging) for net in self.nets]
        return tuple(torch.stack(parts).mean(0) for parts in zip(*said, strict=True))


def _scores(net: Any, embedded: Tensor, averaging: Tensor) -> tuple[Tensor, ...]:
    encoder = net.encoder
    x = encoder.norm(embedded + encoder.position(torch.arange(embedded.shape[1])) + encoder.kind)
    bias = torch.zeros(1, 1, 1, 1)
    for layer in encoder.layers:
        x = layer(x, bias)
    mentions, first = net.mentions(x, averaging), x[:, 0]
    return (
        net.whole(x, torch.ones_like(x[..., 0])),
        net.one_scores(mentions, first),
        net.pair_scores(mentions, first),
        net.object(x),
        net.anchor(x),
        net.tagger(x)[..., 0],
    )


NAMES = ("whole", "ones", "pairs", "objects", "anchors", "tags")


def export(nets: Sequence[Reader], base: Path, out: Path, about: dict[str, Any]) -> None:
    """Writes the four files that services.llm_parser.reader.model reads."""
    exported = Exported(nets).eval()
    words = nets[0].encoder.word.weight.detach().numpy()
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        plain = Path(folder) / "reader.onnx"
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
            str(out / "reader.onnx"),
            per_channel=True,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=["MatMul"],
        )
    scales = np.abs(words).max(axis=1).clip(min=1e-6) / 127.0
    np.savez(
        out / "words.npz", words=np.rint(words / scales[:, None]).astype(np.int8), scales=scales.astype(np.float32)
    )
    shutil.copy(base / "tokenizer.json", out / "tokenizer.json")
    (out / "about.json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")

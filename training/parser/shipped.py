"""An exported reader's networks as training has them: their weights out of the integers that the service runs."""

from pathlib import Path

import numpy as np
import onnx
import torch
import zstandard
from google.protobuf.message import DecodeError
from numpy.typing import NDArray
from onnx import numpy_helper
from torch import Tensor

from services.llm_parser.reader.model import NETWORK

WORDS = "encoder.word.weight"
"""What an export holds apart, and a training begins with from the base."""


def weights_of(folder: Path, at: int) -> dict[str, Tensor]:
    """By their names in training.parser.net.Reader, the weights but WORDS of network number `at` of an export. Raises
    OSError; ValueError where the file holds none."""
    path = folder / NETWORK
    try:
        graph = onnx.load_from_string(zstandard.decompress(path.read_bytes())).graph
    except (zstandard.ZstdError, DecodeError) as error:
        raise ValueError(f"{path} holds no exported reader: {error}") from error
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    inside = f"nets.{at}."
    found: dict[str, NDArray[np.float32]] = {
        name.removeprefix(inside): values
        for name, values in stored.items()
        if name.startswith(inside) and values.dtype == np.float32 and not name.endswith("_scale")
    }
    for node in graph.node:
        if node.op_type == "MatMulInteger" and (layer := _layer(node.name, at)) is not None:
            integers = node.input[1].removesuffix("_quantized")
            steps = stored[node.input[1]].astype(np.float32) - stored[f"{integers}_zero_point"]
            found[f"{layer}.weight"] = (steps * stored[f"{integers}_scale"]).T
    return {name: torch.from_numpy(values.copy()) for name, values in found.items()}


def _layer(node: str, at: int) -> str | None:
    """The linear layer that a node is of, as `encoder.layers.0.qkv` of network 1 is that of `/layers.0/qkv_1/…`;
    null for another network's."""
    *parents, last = node.strip("/").split("/")[:-1]
    plain, _, number = last.partition("_")
    if int(number or 0) != at:
        return None
    if parents and plain.startswith(f"{parents[-1]}."):  # a sequence's name stands twice: /none/none.0
        parents = parents[:-1]
    name = ".".join((*parents, plain))
    return f"encoder.{name}" if name.startswith("layers.") else name

"""The proposer in eight-bit integers: half the time of its 32-bit numbers, same answers but for a rounding.

`Arranged` computes what `Proposer` does, put so that ONNX Runtime's integer kernels have little to move: four pixels
of a row side by side are one cell of twelve channels, and doubling a map is copying its cells and rows. `quantise`
then takes each map's range from pictures (static quantisation, one scale a channel for weights, one a map for
activations). Weights keep seven bits: with eight, processors without VNNI saturate where two products are summed.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
from onnxruntime.quantization.shape_inference import quant_pre_process
from torch import Tensor, nn

from training.nets import MIDDLE, SPREAD, ConvUnit, Proposer, scaled

CELL = 4
"""Pixels of a row that make one cell."""
_OPERATIONS = ["Conv", "Add", "Relu", "Concat", "Reshape", "Transpose"]


class Arranged(nn.Module):
    """`Proposer.forward`, for export only. pictures: uint8 (N, H, W, 3), H and W multiples of 32."""

    def __init__(self, net: Proposer) -> None:
        super().__init__()
        self.net = net
        first = net.stem[0]
        assert isinstance(first, ConvUnit)
        self.first = FirstInCells(first)

    def forward(self, pictures: Tensor) -> Tensor:
        net, (height, width) = self.net, pictures.shape[1:3]
        fine = net.stem[2](net.stem[1](self.first(pictures)))
        middle = net.middle(fine)
        coarse = net.coarse(middle)
        middle = torch.relu(middle + doubled(net.from_coarse(coarse), height // 16, width // 16))
        fine = torch.relu(fine + doubled(net.from_middle(middle), height // 8, width // 8))
        maps: Tensor = net.out(net.head(fine))
        return maps


class FirstInCells(nn.Module):
    """The first unit, of stride 2, over cells of CELL pixels: each cell gives two neighbouring columns at once.

    uint8 (N, H, W, 3) to float32 (N, C, H / 2, W / 2).
    """

    def __init__(self, unit: ConvUnit) -> None:
        super().__init__()
        weight, bias = folded(unit)
        self.channels = weight.shape[0]
        wide = torch.zeros(2 * self.channels, CELL * 3, 3, 3)
        for column in range(2):
            for tap in range(3):
                cell, pixel = divmod(2 * column + tap - 1 + CELL, CELL)
                rows = slice(column * self.channels, (column + 1) * self.channels)
                wide[rows, pixel * 3 : pixel * 3 + 3, :, cell] = weight[:, :, :, tap]
        self.conv = nn.Conv2d(CELL * 3, 2 * self.channels, 3, (2, 1), 1)
        with torch.no_grad():
            self.conv.weight.copy_(wide)
            self.conv.bias.copy_(torch.cat([bias, bias]))

    def forward(self, pictures: Tensor) -> Tensor:
        number, height, width = pictures.shape[:3]
        columns = torch.relu(self.conv(scaled(pictures.reshape(number, height, -1, CELL * 3)))).permute(0, 2, 3, 1)
        return columns.reshape(number, -1, width // 2, self.channels).permute(0, 3, 1, 2)


def folded(unit: ConvUnit) -> tuple[Tensor, Tensor]:
    """Weight and bias of one convolution that does what a trained unit's convolution and normalisation do."""
    conv, norm = unit[0], unit[1]
    assert isinstance(conv, nn.Conv2d)
    assert isinstance(norm, nn.BatchNorm2d)
    assert norm.running_mean is not None
    assert norm.running_var is not None
    scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    return (conv.weight * scale[:, None, None, None]).detach(), (norm.bias - norm.running_mean * scale).detach()


def doubled(x: Tensor, height: int, width: int) -> Tensor:
    """(N, C, height / 2, width / 2) to (N, C, height, width), each value four times."""
    channels = x.shape[1]
    cells = x.permute(0, 2, 3, 1)
    rows = torch.cat([cells, cells], 3).reshape(-1, 1, width * channels)
    return torch.cat([rows, rows], 1).reshape(-1, height, width, channels).permute(0, 3, 1, 2)


def quantise(exported: Path, pictures: Iterable[NDArray[np.uint8]], out: Path) -> None:
    """The network of `exported` (made from `Arranged`) in integers; its last convolution stays as it is, because boxes
    are exponentials of what it says. pictures: (H, W, 3) each, from which the maps' ranges are taken."""
    with TemporaryDirectory(dir=out.parent) as folder:
        plain = Path(folder) / "plain.onnx"
        quant_pre_process(str(exported), str(plain), skip_symbolic_shape=True)
        nodes = onnx.load(str(plain)).graph.node
        pixels = next(node.output[0] for node in nodes if node.op_type == "DequantizeLinear")
        bytes_as_they_are = {"scale": np.array(1 / SPREAD, np.float32), "zero_point": np.array(MIDDLE, np.uint8)}
        part = Path(folder) / "part.onnx"
        quantize_static(
            str(plain),
            str(part),
            _Pictures(pictures),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            reduce_range=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=_OPERATIONS,
            nodes_to_exclude=[[node.name for node in nodes if node.op_type == "Conv"][-1]],
            extra_options={"TensorQuantOverrides": {pixels: [bytes_as_they_are]}},
        )
        part.rename(out)


class _Pictures(CalibrationDataReader):
    def __init__(self, pictures: Iterable[NDArray[np.uint8]]) -> None:
        self._rest: Iterator[NDArray[np.uint8]] = iter(pictures)

    def get_next(self) -> dict[str, NDArray[np.uint8]] | None:
        picture = next(self._rest, None)
        return None if picture is None else {"pictures": picture[None]}

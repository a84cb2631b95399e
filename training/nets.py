"""The two networks: the proposer says where something stands, the namer what it is.

Both take pictures as the camera's JPEGs decode, uint8 (N, H, W, 3) RGB, so that whoever runs them prepares nothing.
Channel widths are multiples of 16, which the processor's convolutions like.
"""

from typing import Any

import torch
from torch import Tensor, nn

STRIDE = 8
MAPS = 8
"""objectness, four box distances, building, window, row"""
MIDDLE, SPREAD = 118, 64.0
"""Of a byte of a picture, as the networks take it."""


class ConvUnit(nn.Sequential):
    """Convolution, normalisation, rectifier."""

    def __init__(self, inside: int, outside: int, stride: int = 1, kernel: int = 3) -> None:
        super().__init__(
            nn.Conv2d(inside, outside, kernel, stride, kernel // 2, bias=False),
            nn.BatchNorm2d(outside),
            nn.ReLU(inplace=True),
        )


class Residual(nn.Module):
    """Two convolutions beside a short cut."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = ConvUnit(width, width)
        self.second = nn.Sequential(nn.Conv2d(width, width, 3, 1, 1, bias=False), nn.BatchNorm2d(width))

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(x + self.second(self.first(x)))


class Proposer(nn.Module):
    """Maps at stride 8. `forward` gives raw maps (N, MAPS, h, w) for training; `answer` what is exported."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(ConvUnit(3, 16, 2), ConvUnit(16, 32, 2), ConvUnit(32, 48, 2))
        self.middle = nn.Sequential(ConvUnit(48, 64, 2), Residual(64))
        self.coarse = nn.Sequential(ConvUnit(64, 96, 2), Residual(96))
        self.from_coarse = nn.Conv2d(96, 64, 1)
        self.from_middle = nn.Conv2d(64, 48, 1)
        self.head = ConvUnit(48, 48)
        self.out = nn.Conv2d(48, MAPS, 1)
        nn.init.normal_(self.out.weight, std=0.01)
        with torch.no_grad():
            self.out.bias.copy_(torch.tensor([-4.0, 1.0, 1.0, 1.0, 1.0, 0.0, -2.0, -2.0]))

    def forward(self, pictures: Tensor) -> Tensor:
        fine = self.stem(scaled(pictures))
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        middle = torch.relu(middle + _doubled(self.from_coarse(coarse)))
        fine = torch.relu(fine + _doubled(self.from_middle(middle)))
        maps: Tensor = self.out(self.head(fine))
        return maps


class ProposerAnswer(nn.Module):
    """What `proposer.onnx` holds: probabilities, and box distances in pixels. `net` gives the raw maps."""

    def __init__(self, net: nn.Module) -> None:
        super().__init__()
        self.net = net

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        maps = self.net(pictures)
        sure = torch.sigmoid(maps)
        return sure[:, 0], distances_px(maps), sure[:, 5], sure[:, 6], sure[:, 7]


def distances_px(maps: Tensor) -> Tensor:
    """(N, 4, h, w): left, top, right, bottom, pixels from the cell's centre."""
    return torch.exp(torch.clamp(maps[:, 1:5], -3.0, 4.5)) * STRIDE


class Namer(nn.Module):
    """Class, colour and a tighter box of one crop; `forward` is what is exported."""

    def __init__(self, kinds: int, colours: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            ConvUnit(3, 16, 2),
            ConvUnit(16, 32, 2),
            Residual(32),
            ConvUnit(32, 64, 2),
            Residual(64),
            ConvUnit(64, 128, 2),
            Residual(128),
        )
        self.kind = nn.Linear(128 * 2, kinds + 1)
        self.colour = nn.Linear(128 + 64, colours)
        self.box = nn.Linear(128 * 4, 4)
        nn.init.zeros_(self.box.weight)
        with torch.no_grad():
            self.box.bias.copy_(torch.tensor([0.19, 0.19, 0.81, 0.81]))

    def forward(self, crops: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        middle = self.body[:5](scaled(crops))
        last = self.body[5:](middle)
        mean, most = last.mean(dim=(2, 3)), last.amax(dim=(2, 3))
        side = middle.shape[2]
        inner = middle[:, :, side // 4 : side - side // 4, side // 4 : side - side // 4].mean(dim=(2, 3))
        half = last.shape[2] // 2
        rows = torch.cat([last[:, :, :half].mean(dim=(2, 3)), last[:, :, half:].mean(dim=(2, 3))], 1)
        columns = torch.cat([last[:, :, :, :half].mean(dim=(2, 3)), last[:, :, :, half:].mean(dim=(2, 3))], 1)
        return (
            self.kind(torch.cat([mean, most], 1)),
            self.colour(torch.cat([mean, inner], 1)),
            self.box(torch.cat([rows, columns], 1)),
        )


def scaled(pictures: Tensor) -> Tensor:
    """uint8 (N, H, W, 3) to float32 (N, 3, H, W) about zero."""
    numbers: Tensor = _FromBytes.apply(pictures.permute(0, 3, 1, 2))
    return numbers


class _FromBytes(torch.autograd.Function):
    """Exported as one operation: as three they take a fifth of the proposer's time."""

    @staticmethod
    def forward(_: Any, pixels: Tensor) -> Tensor:
        return (pixels.to(torch.float32) - MIDDLE) * (1 / SPREAD)

    @staticmethod
    def symbolic(graph: Any, pixels: Any) -> Any:
        scale = graph.op("Constant", value_t=torch.tensor(1 / SPREAD))
        zero = graph.op("Constant", value_t=torch.tensor(MIDDLE, dtype=torch.uint8))
        return graph.op("DequantizeLinear", pixels, scale, zero)


def _doubled(x: Tensor) -> Tensor:
    return nn.functional.interpolate(x, scale_factor=2.0, mode="nearest")

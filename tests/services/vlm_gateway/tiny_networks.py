"""Two networks small enough to know their answers by heart, in the files that trained ones come in.

Their world: sky is blue, walls are grey, a green line one cell high runs along the middle of each row of windows, and
things are squares of 40 pixels in red, green or blue, aligned to the cells: a `plate` is plain, a `target` has a white
dot in its middle.
"""

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from contracts.sim import CatalogueEntry
from services.vlm_gateway.embedded.exported import (
    MODEL_FILE,
    NAMER_FILE,
    PROPOSER_FILE,
    Calibration,
    Exported,
    Proposing,
)

STRIDE, THING_PX, CROP_PX, CONTEXT = 8, 40, 32, 1.6
SKY, WALL, LINE = (150, 190, 230), (128, 128, 128), (90, 200, 90)
PAINT = {"red": (200, 30, 30), "green": (20, 190, 20), "blue": (30, 30, 200)}
PROPOSING = Proposing(threshold=0.7)
COLOURS = ("blue", "green", "red")


def entry(kind: str, *synonyms: str) -> CatalogueEntry:
    return CatalogueEntry(
        kind=kind,
        category="household",
        phrase=kind.replace("_", " "),
        synonyms=synonyms,
        colours=COLOURS,
        places=("sill",),
        size_m=(0.3, 0.3, 0.3),
    )


ENTRIES = (entry("plate", "dish"), entry("target", "bull's eye", "dart board"))


def write_networks(folder: Path, **changes: object) -> Path:
    """The three files; `changes` are of `model.json`."""
    folder.mkdir(parents=True, exist_ok=True)
    onnx.save(_proposer(), folder / PROPOSER_FILE)
    onnx.save(_namer(), folder / NAMER_FILE)
    exported = Exported(
        version="tiny",
        picture_px=320,
        stride=STRIDE,
        crop_px=CROP_PX,
        crop_context=CONTEXT,
        kinds=("plate", "target"),
        colours=COLOURS,
        entries=ENTRIES,
        calibration=Calibration(score=(0.0, 0.5, 1.0), probability=(0.0, 0.6, 1.0)),
        proposing=PROPOSING,
        vocabulary_sha256="0" * 64,
    ).model_copy(update=changes)
    (folder / MODEL_FILE).write_text(exported.model_dump_json(), encoding="utf-8")
    return folder


def street(things: dict[tuple[int, int], str], *, rows: tuple[int, ...] = (), roof: int = 0) -> NDArray[np.uint8]:
    """A picture of 320 x 320: things by the cell of their upper left corner, e.g. "red target"; lines in these rows of
    cells; sky above the row of cells `roof`."""
    rgb = np.full((320, 320, 3), WALL, np.uint8)
    rgb[: roof * STRIDE] = SKY
    for row in rows:
        rgb[row * STRIDE : (row + 1) * STRIDE] = LINE
    for (row, column), what in things.items():
        colour, kind = what.split()
        y, x = row * STRIDE, column * STRIDE
        rgb[y : y + THING_PX, x : x + THING_PX] = PAINT[colour]
        if kind == "target":
            rgb[y + 16 : y + 24, x + 16 : x + 24] = 255
    return rgb


class _Graph:
    """Nodes one after the other; every call returns the name of its output."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def add(self, kind: str, *inputs: str, out: str | None = None, **attributes: Any) -> str:
        name = out or f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def value(self, value: object, dtype: type = np.float32) -> str:
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value, dtype), name))
        return name

    def linear(self, x: str, weight: object, bias: object, out: str | None = None) -> str:
        return self.add("Add", self.add("MatMul", x, self.value(weight)), self.value(bias), out=out)

    def line(self, x: str, times: float, plus: float) -> str:
        return self.add("Add", self.add("Mul", x, self.value(times)), self.value(plus))

    def unit(self, x: str, out: str | None = None) -> str:
        return self.add("Clip", x, self.value(0.0), self.value(1.0), out=out)

    def channel(self, x: str, k: int) -> str:
        """(N, 3, h, w) -> (N, h, w)."""
        return self.add("Gather", x, self.value(k, np.int64), axis=1)

    def model(self, inputs: list[onnx.ValueInfoProto], outputs: list[onnx.ValueInfoProto]) -> onnx.ModelProto:
        graph = helper.make_graph(self.nodes, "tiny", inputs, outputs, self.constants)
        made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
        onnx.checker.check_model(made)
        return made


def _shares(g: _Graph, pictures: str) -> str:
    """uint8 (N, H, W, 3) -> (N, 3, H, W) in 0..1."""
    floats = g.add("Div", g.add("Cast", pictures, to=TensorProto.FLOAT), g.value(255.0))
    return g.add("Transpose", floats, perm=[0, 3, 1, 2])


def _proposer() -> onnx.ModelProto:
    g = _Graph()
    cells = g.add("AveragePool", _shares(g, "pictures"), kernel_shape=[STRIDE] * 2, strides=[STRIDE] * 2)
    red, green, blue = (g.channel(cells, k) for k in range(3))
    # things are strongly coloured, more than lines and sky; five cells wide, so that the mean peaks in their middle
    axes: dict[str, Any] = {"axes": [1], "keepdims": 1}
    spread = g.add("Sub", g.add("ReduceMax", cells, **axes), g.add("ReduceMin", cells, **axes))
    brightest = g.add("ReduceMin", cells, **axes)
    either = g.add("Max", g.unit(g.line(spread, 8.0, -3.9)), g.unit(g.line(brightest, 8.0, -7.0)))
    middle = g.add("AveragePool", either, kernel_shape=[5, 5], strides=[1, 1], pads=[2, 2, 2, 2], count_include_pad=1)
    g.add("Squeeze", middle, g.value([1], np.int64), out="objectness")
    half = g.line(middle, 0.0, THING_PX / 2)
    g.add("Concat", half, half, half, half, out="box", axis=1)
    g.unit(g.line(g.add("Sub", blue, red), -8.0, 1.5), out="building")
    g.unit(g.line(red, -8.0, 1.0), out="window")
    g.unit(g.line(g.add("Sub", green, g.add("Max", red, blue)), 4.0, -0.5), out="row")
    maps = [
        helper.make_tensor_value_info(n, TensorProto.FLOAT, ["n", "h", "w"])
        for n in ("objectness", "building", "window", "row")
    ]
    box = helper.make_tensor_value_info("box", TensorProto.FLOAT, ["n", 4, "h", "w"])
    pictures = helper.make_tensor_value_info("pictures", TensorProto.UINT8, ["n", "H", "W", 3])
    return g.model([pictures], [*maps, box])


def _namer() -> onnx.ModelProto:
    g = _Graph()
    pixels = _shares(g, "crops")
    quarter, half = CROP_PX // 4, CROP_PX // 2
    cut = [g.value(v, np.int64) for v in ([half - 1] * 2, [half + 1] * 2, [2, 3])]
    dot = g.add("ReduceMean", g.add("Slice", pixels, *cut), axes=[2, 3], keepdims=0)
    white = g.add("ReduceMin", dot, axes=[1], keepdims=1)
    cut = [g.value(v, np.int64) for v in ([quarter] * 2, [CROP_PX - quarter] * 2, [2, 3])]
    inner = g.add("ReduceMean", g.add("Slice", pixels, *cut), axes=[2, 3], keepdims=0)
    spread = g.add(
        "Sub", g.add("ReduceMax", inner, axes=[1], keepdims=1), g.add("ReduceMin", inner, axes=[1], keepdims=1)
    )
    plate, target, nothing = g.line(white, -40.0, 10.0), g.line(white, 40.0, -20.0), g.line(spread, -80.0, 10.0)
    g.add("Concat", plate, target, nothing, out="kind", axis=1)
    g.linear(inner, np.array([[0, 0, 30.0], [0, 30.0, 0], [30.0, 0, 0]]), np.zeros(3), out="colour")
    margin = (1 - 1 / CONTEXT) / 2
    g.linear(inner, np.zeros((3, 4)), [margin, margin, 1 - margin, 1 - margin], out="box")
    outputs = [
        helper.make_tensor_value_info(n, TensorProto.FLOAT, ["m", k])
        for n, k in (("kind", 3), ("colour", 3), ("box", 4))
    ]
    crops = helper.make_tensor_value_info("crops", TensorProto.UINT8, ["m", CROP_PX, CROP_PX, 3])
    return g.model([crops], outputs)

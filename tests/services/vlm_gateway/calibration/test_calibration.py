"""How a model writes boxes is found out by asking models that really look at the picture."""

import base64
import contextlib
import io
import json
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest

from services.vlm_gateway.calibration.__main__ import main
from services.vlm_gateway.calibration.fit import Pair, fit, resized
from services.vlm_gateway.calibration.picture import COLOURS, HEIGHT, WIDTH, Corners, draw
from services.vlm_gateway.calibration.reading import boxes_in
from services.vlm_gateway.chat.boxes import Size, smart_resize
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import build, chat_backend
from tests.services.vlm_gateway.openai_mock import Behaviour, OpenAiMock, says, sends, status

Writes = Callable[[Corners], list[float]]


@pytest.fixture(scope="module")
def mock() -> Iterator[OpenAiMock]:
    mock = OpenAiMock().start()
    yield mock
    mock.stop()


def looked_at(body: dict[str, Any]) -> dict[str, Corners]:
    """What a model with good eyes sees: the outline of every colour, in 0..1."""
    parts = body["messages"][-1]["content"]
    url = next(part["image_url"]["url"] for part in parts if part["type"] == "image_url")
    data = np.frombuffer(base64.b64decode(url.partition(",")[2]), np.uint8)
    pixels = cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB).astype(int)
    seen = {}
    for name, colour in COLOURS.items():
        rows, columns = np.nonzero(np.abs(pixels - colour).sum(axis=2) < 90)
        seen[name] = Corners(
            columns.min() / pixels.shape[1],
            rows.min() / pixels.shape[0],
            (columns.max() + 1) / pixels.shape[1],
            (rows.max() + 1) / pixels.shape[0],
        )
    return seen


def scaled(width: float, height: float, order: str, digits: int = 0) -> Writes:
    def write(box: Corners) -> list[float]:
        x0, y0, x1, y1 = box.x0 * width, box.y0 * height, box.x1 * width, box.y1 * height
        numbers = {"xyxy": (x0, y0, x1, y1), "yxyx": (y0, x0, y1, x1), "xywh": (x0, y0, x1 - x0, y1 - y0)}[order]
        return [round(float(number), digits) for number in numbers]

    return write


def model(writes: Writes, wrap: Callable[[list[tuple[str, list[float]]]], str] | None = None) -> Behaviour:
    async def behave(request: Any, body: dict[str, Any]) -> Any:
        told = [(colour, writes(box)) for colour, box in looked_at(body).items()]
        text = (
            wrap(told) if wrap else json.dumps([{"bbox_2d": box, "label": f"{colour} shape"} for colour, box in told])
        )
        return await says(text)(request, body)

    return behave


QWEN28 = smart_resize(Size(WIDTH, HEIGHT), 28, 3136, 12_845_056)
QWEN32 = smart_resize(Size(WIDTH, HEIGHT), 32, 65_536, 16_777_216)

CONVENTIONS = [
    ("unit", "xyxy", None, scaled(1, 1, "xyxy", 3)),
    ("unit", "yxyx", None, scaled(1, 1, "yxyx", 3)),
    ("unit", "xywh", None, scaled(1, 1, "xywh", 3)),
    ("thousand", "xyxy", None, scaled(1000, 1000, "xyxy")),
    ("thousand", "yxyx", None, scaled(1000, 1000, "yxyx")),
    ("thousand", "xywh", None, scaled(1000, 1000, "xywh")),
    ("pixels", "xyxy", None, scaled(WIDTH, HEIGHT, "xyxy")),
    ("pixels", "yxyx", None, scaled(WIDTH, HEIGHT, "yxyx")),
    ("pixels", "xywh", None, scaled(WIDTH, HEIGHT, "xywh")),
    ("resized_pixels", "xyxy", 28, scaled(*QWEN28, "xyxy")),
    ("resized_pixels", "xywh", 28, scaled(*QWEN28, "xywh")),
    ("resized_pixels", "xyxy", 32, scaled(*QWEN32, "xyxy")),
]


class Ran(NamedTuple):
    """A command that ended."""

    exit_code: int
    stdout: str
    stderr: str


def calibrate(*arguments: str) -> Ran:
    """The command, in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(arguments, {})
    return Ran(code, out.getvalue(), err.getvalue())


def calibrated(serve: Serve, mock: OpenAiMock, *more: str, **settings: Any) -> Ran:
    """The command before a gateway whose model `m` is `mock`."""
    url = serve(build({"m": chat_backend(mock, **settings)}).app)
    return calibrate("m", "--gateway", url, *more)


@pytest.mark.parametrize(("boxes", "order", "factor", "writes"), CONVENTIONS)
def test_a_model_s_convention_is_found_whatever_it_is(
    serve: Serve, mock: OpenAiMock, boxes: str, order: str, factor: int | None, writes: Writes
) -> None:
    mock.will(model(writes))
    result = calibrated(serve, mock, "--json", preset="generic-vision")
    assert result.stdout, result.stderr
    told = json.loads(result.stdout)
    assert (told["boxes"], told["box_order"], told["image_factor"]) == (boxes, order, factor)
    assert (told["certainty"], told["ok"], result.exit_code) == ("sure", True, 0)
    assert told["agrees"] is ((boxes, order) == ("unit", "xyxy"))
    assert told["shapes_told"] == told["shapes_shown"] == 18
    assert told["overlap"] > 0.9 > 0.97 * told["rival_overlap"]


def test_the_advice_is_what_the_configuration_takes(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(model(scaled(1000, 1000, "yxyx")))
    result = calibrated(serve, mock, preset="qwen2-vl")
    assert "[models.m]" in result.stdout
    advised = [line for line in result.stdout.splitlines() if line.startswith("box")]
    assert advised == ['boxes = "thousand"', 'box_order = "yxyx"']
    settings = dict(line.replace('"', "").split(" = ") for line in advised)
    again = calibrated(serve, mock, preset="qwen2-vl", **settings)
    assert "The gateway is configured so." in again.stdout


WRAPPINGS: list[tuple[str, Callable[[list[tuple[str, list[float]]]], str]]] = [
    ("fenced", lambda told: "Here:\n```json\n" + json.dumps([{"box_2d": b, "label": c} for c, b in told]) + "\n```"),
    ("one object", lambda told: json.dumps({"objects": {f"the {c} one": b for c, b in told}})),
    ("nested", lambda told: json.dumps([{"label": c, "bbox": [b]} for c, b in told])),
    ("named", lambda told: json.dumps([{"name": c, **dict(zip("abcd", b, strict=True))} for c, b in told])),
    ("InternVL", lambda told: "\n".join(f"<ref>{c} thing</ref><box>[{b}]</box>" for c, b in told)),
    ("prose", lambda told: "\n".join(f"- {c}: ({b[0]}, {b[1]}), ({b[2]}, {b[3]})" for c, b in told)),
    ("reasoning", lambda told: '<think>[{"label": "red", "b": [1, 2, 3, 4]}]</think>' + json.dumps(dict(told))),
]


@pytest.mark.parametrize("wrap", [w[1] for w in WRAPPINGS], ids=[w[0] for w in WRAPPINGS])
def test_boxes_are_found_however_they_are_wrapped(serve: Serve, mock: OpenAiMock, wrap: Any) -> None:
    mock.will(model(scaled(1000, 1000, "xyxy"), wrap))
    told = json.loads(calibrated(serve, mock, "--json", "--rounds", "1").stdout)
    assert (told["boxes"], told["box_order"], told["shapes_told"]) == ("thousand", "xyxy", 6)


@pytest.mark.parametrize(
    "behaviour",
    [
        says("I see some nice shapes."),
        says(""),
        says("I'm sorry, I can't do that."),
        says(json.dumps([{"label": c, "bbox_2d": [10, 10, 20, 20]} for c in COLOURS])),
        says(json.dumps([{"label": c, "bbox_2d": [7 * i % 5, i * i, 3, 900 - i]} for i, c in enumerate(COLOURS)])),
        sends(b'{"choices": [{"message": {"role": "assistant", "content": null}}]}'),
    ],
)
def test_nonsense_is_called_nonsense(serve: Serve, mock: OpenAiMock, behaviour: Behaviour) -> None:
    mock.will(behaviour)
    result = calibrated(serve, mock, "--json")
    told = json.loads(result.stdout)
    assert (told["certainty"], told["ok"], told["config"], told["agrees"]) == ("none", False, "", None)
    assert result.exit_code == 1
    assert "does not give boxes" in calibrated(serve, mock).stdout


def test_a_scale_nobody_knows_is_told_as_such(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(model(scaled(224, 448, "xyxy")))
    told = json.loads(calibrated(serve, mock, "--json").stdout)
    assert (told["boxes"], told["box_order"], told["config"]) == ("other", "xyxy", "")
    assert told["full"] == [pytest.approx(224, rel=0.03), pytest.approx(448, rel=0.03)]


def test_a_model_with_poor_eyes_is_likely_or_unclear_but_not_sure(serve: Serve, mock: OpenAiMock) -> None:
    chance = np.random.default_rng(7)

    def poor(box: Corners) -> list[float]:
        return [float(round(edge * 1000 + chance.normal(0, 25))) for edge in box]

    mock.will(model(poor))
    told = json.loads(calibrated(serve, mock, "--json").stdout)
    assert (told["boxes"], told["box_order"]) == ("thousand", "xyxy")
    assert told["certainty"] == "likely"


def test_what_can_t_be_asked_is_no_calibration(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    unknown = calibrate("nobody", "--gateway", url)
    assert (unknown.exit_code, "nobody" in unknown.stderr) == (2, True)
    mock.will(status(401))
    refused = calibrate("m", "--gateway", url)
    assert (refused.exit_code, "check its api_key" in refused.stderr) == (1, True)
    nowhere = calibrate("m", "--gateway", "http://127.0.0.1:9")
    assert (nowhere.exit_code, "can't reach" in nowhere.stderr) == (1, True)


def test_the_shapes_are_where_they_are_said_to_be() -> None:
    for seed in range(20):
        picture = draw(np.random.default_rng(seed))
        for shape in picture.shapes:
            rows, columns = np.nonzero((picture.rgb == COLOURS[shape.colour]).all(axis=2))
            edges = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
            truth = (shape.box.x0 * WIDTH, shape.box.y0 * HEIGHT, shape.box.x1 * WIDTH, shape.box.y1 * HEIGHT)
            assert np.abs(np.array(edges) - truth).max() <= 1.6


def test_the_sizes_of_the_processors_are_those_the_gateway_reckons_with() -> None:
    assert (resized(28), resized(32)) == (tuple(map(float, QWEN28)), tuple(map(float, QWEN32)))


def test_nothing_told_is_nothing_found() -> None:
    found = fit([Pair(Corners(0.1, 0.1, 0.2, 0.2), None)] * 6)
    assert (found.certainty, found.told, found.best.overlap) == ("none", 0, 0.0)


@pytest.mark.parametrize(
    "text", ["[" * 50_000, '{"a":' * 5000, "red " * 20_000, '[{"label": "red", "b": [1e999, 0, 0, 0]}]']
)
def test_hostile_answers_are_read_without_harm(text: str) -> None:
    assert boxes_in(text) == []

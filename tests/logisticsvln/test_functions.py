"""Functions and arguments of other people: told before a flight where they can't do, and never waited for in vain."""

import asyncio
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contracts.geometry import Point3
from contracts.images import JpegImage, encode_jpeg
from contracts.vlm_gateway import FloorCountQuestion
from logisticsvln import BadDelivery, BadScene, LocalServices, NextStop, NothingLeft, OwnVision, fly
from logisticsvln.flights import LoopThread
from logisticsvln.functions import authors_part, call, must_take
from logisticsvln.policies import of_function
from service_kit.addresses import Addresses

NOBODY = Addresses(*(f"http://127.0.0.1:{port}" for port in (1, 2, 3, 4)))
PICTURE: JpegImage = encode_jpeg(np.zeros((16, 16, 3), np.uint8))


@pytest.fixture(scope="module")
def nowhere() -> Iterator[LocalServices]:
    """Services that nobody answers for: what is told is told before they are asked."""
    with LocalServices(at=NOBODY) as services:
        yield services


@pytest.mark.parametrize(
    ("asked", "problem"),
    [
        ({"request": ""}, r"^request: .*at least 1 character"),
        ({"request": "floor 3, the kite. " * 6000}, r"^request: .*at most 4000 characters"),
        ({"request": 5}, r"^request: .*valid string"),
        ({"request": "\ud800 floor 3"}, r"^request: "),
        ({"scene": {"name": "a"}, "sample": None}, r"^scene\.buildings: Field required"),
        ({"settings": {"imagesize": 320}}, r"^settings: imagesize: there is no such field"),
        ({"settings": 3, "policy": "paper"}, r"^settings: Input should be a valid dictionary"),
        ({"policy": lambda look: None}, r"^policy: it is called with \(look, tools\); <lambda>\(look\) takes other"),
        ({"vision": lambda views: None}, r"^vision: find_object: it is called with \(views, phrase\)"),
        ({"vision": "two words"}, r"^backend: "),
        ({"answers": 5}, "^answers: give a list of texts"),
        ({"answers": ["4", 5]}, "^answers: give a list of texts"),
        ({"answers": lambda: "4"}, r"^answers: it is called with \(question\)"),
        ({"on_event": 5}, r"^on_event: give a function of \(event\), not 5"),
    ],
)
def test_an_argument_that_cannot_do_is_told_before_the_flight(
    nowhere: LocalServices, tmp_path: Path, asked: dict[str, Any], problem: str
) -> None:
    with pytest.raises(BadDelivery, match=problem):
        nowhere.fly(**({"sample": "street-kite", "out": tmp_path / "runs"} | asked))
    assert list(tmp_path.iterdir()) == []


def test_a_single_flight_that_cannot_be_is_told_before_a_service_is_started(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr("sys.executable", "/nowhere/python")
    with pytest.raises(BadDelivery, match="there is no sample 'streetkite'"):
        fly(sample="streetkite", out=tmp_path)
    with pytest.raises(BadScene, match=r"nowhere\.json: No such file"):
        fly("floor 3, the kite", tmp_path / "nowhere.json", out=tmp_path)


def test_settings_may_be_a_dictionary(nowhere: LocalServices, tmp_path: Path) -> None:
    with pytest.raises(BadDelivery, match="either a scene or the name of a sample"):
        nowhere.fly(settings={"image_size": 320}, policy="paper", out=tmp_path)


@pytest.mark.parametrize("function", [print, max, lambda *words: words, len, call])
def test_a_function_that_takes_them_is_taken_whatever_else_it_takes(function: Callable[..., object]) -> None:
    taken = ("views",) if function is len else ("look", "tools")
    assert must_take(function, taken, "policy") is function


@pytest.mark.parametrize("leaving", [SystemExit(3), StopIteration("over"), KeyboardInterrupt()])
async def test_a_function_that_would_end_the_program_or_the_loop_raises_instead(leaving: BaseException) -> None:
    def leave() -> None:
        raise leaving

    async def leave_awaited() -> None:
        raise leaving

    with pytest.raises(RuntimeError, match=f"leave ended with {type(leaving).__name__}"):
        await call(leave)
    with pytest.raises(RuntimeError):
        await call(leave_awaited)


def test_a_function_that_never_ends_does_not_hold_an_interrupt_up() -> None:
    waiting, thread = threading.Event(), LoopThread()
    thread.start()

    async def cut_short() -> None:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(call(waiting.wait), 0.01)

    began = time.monotonic()
    thread.run(cut_short())
    thread.stop()
    assert time.monotonic() - began < 5.0
    waiting.set()


async def test_an_error_of_the_authors_function_is_told_from_that_function_on() -> None:
    def broken() -> None:
        raise KeyError("mine")

    async def broken_awaited() -> None:
        broken()

    for function, frames in ((broken, ["broken"]), (broken_awaited, ["broken_awaited", "broken"])):
        with pytest.raises(KeyError) as raised:
            await call(function)
        assert [frame.name for frame in traceback.extract_tb(authors_part(raised.value))] == frames
    with pytest.raises(ValueError, match="ours") as ours:
        raise ValueError("ours")
    assert authors_part(ours.value) is ours.value.__traceback__


@pytest.mark.parametrize(
    ("said", "problem"),
    [
        (None, "a policy says NextStop"),
        ("left", "a policy says NextStop"),
        (NextStop(((1.0, 2.0, 3.0),), None, "x"), "its path is made of Point3"),  # type: ignore[arg-type]
        (NextStop([Point3(x=0, y=0, z=3)] * 65, None, "x"), "its path has 65 points; a flight has at most 64"),  # type: ignore[arg-type]
        (NextStop((), float("nan"), "x"), "its yaw is a number of radians"),
    ],
)
async def test_what_is_no_next_stop_is_told_to_the_author_of_the_policy(said: object, problem: str) -> None:
    plan = await of_function(lambda look, tools: said).plan(*[None] * 3)  # type: ignore[arg-type, return-value]
    with pytest.raises((TypeError, ValueError), match=problem):
        await plan.onward()


@pytest.mark.parametrize("said", [NextStop([Point3(x=0, y=0, z=3)], np.float32(0.5), "x"), NothingLeft("over")])  # type: ignore[arg-type]
async def test_lists_and_numbers_of_numpy_are_taken(said: NextStop | NothingLeft) -> None:
    plan = await of_function(lambda look, tools: said).plan(*[None] * 3)  # type: ignore[arg-type]
    stop = (await plan.onward()).stop
    assert stop == (((Point3(x=0, y=0, z=3),), 0.5, "x") if isinstance(said, NextStop) else said)


@pytest.mark.parametrize(
    ("said", "floors"), [(np.int64(4), 4), (4, 4), (None, None), ("four", None), (True, None), (4.0, None)]
)
async def test_a_count_is_a_whole_number_of_whatever_make(said: object, floors: int | None) -> None:
    class Mine:
        def count_floors(self, picture: object) -> object:
            return said

    port = OwnVision(Mine()).before(None)  # type: ignore[arg-type]
    question = FloorCountQuestion(image=PICTURE)
    if said is None or floors is not None:
        assert (await port.floor_count(question)).floors == floors
    else:
        with pytest.raises(TypeError, match="count_floors: say a whole number"):
            await port.floor_count(question)

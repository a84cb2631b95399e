"""The renderer's own thread: jobs in order, errors to whoever asked, a bounded line."""

import time
import weakref
from concurrent.futures import wait
from threading import Event, current_thread

import pytest

from services.sim.render.choice import choose_renderer
from services.sim.render.gl import NoGlContext
from services.sim.render.thread import RendererBusy, RenderThread
from services.sim.render.tiny import TinyRenderer
from services.sim.render.views import Renderer


def test_every_job_runs_in_one_thread_that_is_not_the_callers() -> None:
    thread = RenderThread(lambda: TinyRenderer())
    names = {thread.run(lambda _: current_thread().name) for _ in range(3)}
    assert names == {"renderer"}
    thread.close()


def test_a_jobs_error_comes_back_to_its_caller_and_the_thread_lives_on() -> None:
    thread = RenderThread(lambda: TinyRenderer())

    def fail(_: Renderer) -> None:
        raise KeyError("lost")

    with pytest.raises(KeyError, match="lost"):
        thread.run(fail)
    assert thread.run(lambda renderer: renderer.name) == "tiny"
    thread.close()


def test_while_nothing_is_to_be_drawn_nothing_of_the_last_scene_is_kept() -> None:
    class Picture:
        pass

    thread = RenderThread(lambda: TinyRenderer())
    picture = Picture()
    kept = weakref.ref(picture)
    thread.run(lambda _, shown=picture: shown)  # type: ignore[misc]
    del picture
    give_up = time.monotonic() + 10
    while kept() is not None and time.monotonic() < give_up:
        time.sleep(0.01)
    assert kept() is None
    thread.close()


def test_more_than_fit_in_the_line_are_refused() -> None:
    thread = RenderThread(lambda: TinyRenderer(), max_waiting=2)
    started, go = Event(), Event()

    def hold(_: Renderer) -> bool:
        started.set()
        return go.wait(20)

    first = thread.submit(hold)
    started.wait(20)
    waiting = [thread.submit(lambda _: True) for _ in range(2)]
    with pytest.raises(RendererBusy, match="waiting"):
        thread.submit(lambda _: True)
    go.set()
    wait([first, *waiting], timeout=20)
    assert all(f.result() for f in (first, *waiting))
    thread.close()
    with pytest.raises(RendererBusy, match="closed"):
        thread.submit(lambda _: True)


def test_an_error_in_making_the_renderer_reaches_whoever_starts_the_thread() -> None:
    def make() -> Renderer:
        raise NoGlContext("no EGL here")

    with pytest.raises(NoGlContext, match="no EGL here"):
        RenderThread(make)


def test_the_choice_says_what_draws_and_why() -> None:
    asked = choose_renderer("tiny")
    assert asked.name == "tiny"
    assert "settings" in asked.detail
    automatic = choose_renderer("auto")
    assert automatic.name in automatic.detail
    automatic.close()

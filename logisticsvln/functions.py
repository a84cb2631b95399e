"""Somebody's own functions, called beside an event loop: looked at before a flight, and never waited for in vain."""

import asyncio
import contextlib
import contextvars
import inspect
import threading
from collections.abc import Callable
from types import TracebackType
from typing import TypeVar

from orchestrator.delivery import BadDelivery

F = TypeVar("F", bound=Callable[..., object])


def must_take(function: F, arguments: tuple[str, ...], what: str) -> F:
    """The function itself. Raises BadDelivery for what is none, and for one that takes other arguments."""
    if not callable(function):
        raise BadDelivery(f"{what}: give a function of ({', '.join(arguments)}), not {function!r}")
    try:
        signature = inspect.signature(function)
    except ValueError:  # some of those written in C do not say what they take
        return function
    try:
        signature.bind(*arguments)
    except TypeError:
        name = getattr(function, "__name__", type(function).__name__)
        raise BadDelivery(
            f"{what}: it is called with ({', '.join(arguments)}); {name}{signature} takes other"
        ) from None
    return function


async def call(function: Callable[..., object], *arguments: object) -> object:
    """What the function says: awaited where it is asynchronous, else called in a thread of its own, since it may take
    its time. Cancelling leaves such a thread behind; it ends with the process."""
    try:
        if inspect.iscoroutinefunction(function) or inspect.iscoroutinefunction(getattr(function, "__call__", None)):  # noqa: B004
            return await function(*arguments)  # type: ignore[misc]
        said = await _in_a_thread(function, arguments)
        return await said if inspect.isawaitable(said) else said
    except (SystemExit, KeyboardInterrupt) as error:
        raise _ended_by(function, error) from error


async def _in_a_thread(function: Callable[..., object], arguments: tuple[object, ...]) -> object:
    loop, context = asyncio.get_running_loop(), contextvars.copy_context()
    answer: asyncio.Future[object] = loop.create_future()

    def tell(said: object, error: Exception | None) -> None:
        if answer.done():
            return
        if error is None:
            answer.set_result(said)
        else:
            answer.set_exception(error)

    def work() -> None:
        said: object = None
        raised: Exception | None = None
        try:
            said = context.run(function, *arguments)
        except StopIteration as error:  # no future holds one
            raised = _ended_by(function, error)
        except Exception as error:
            raised = error
        except BaseException as error:
            raised = _ended_by(function, error)
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody waits any more
            loop.call_soon_threadsafe(tell, said, raised)

    threading.Thread(target=work, name=getattr(function, "__name__", "function"), daemon=True).start()
    return await answer


def authors_part(error: BaseException) -> TracebackType | None:
    """The error's traceback from the author's own function on; all of it where no such function was called."""
    found = step = error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == __file__ and step.tb_next is not None:
            found = step.tb_next
        step = step.tb_next
    return found


def _ended_by(function: Callable[..., object], error: BaseException) -> RuntimeError:
    name = getattr(function, "__name__", type(function).__name__)
    ended = RuntimeError(f"{name} ended with {type(error).__name__}({error})")
    ended.__cause__ = error
    return ended

import asyncio
import os
import threading
from collections.abc import Callable

import pytest
import uvloop

from service_kit.running_loop import running_loop

RUNNERS = [asyncio.run, uvloop.run]


async def both_agree() -> asyncio.AbstractEventLoop:
    await asyncio.sleep(0)
    assert running_loop() is asyncio.get_running_loop()
    return running_loop()


@pytest.mark.parametrize("run", RUNNERS)
def test_each_loop_of_a_thread_is_found_while_it_runs_and_no_longer(
    run: Callable[..., asyncio.AbstractEventLoop],
) -> None:
    assert run(both_agree()) is not run(both_agree())
    with pytest.raises(RuntimeError, match="no running event loop"):
        running_loop()


def test_loops_of_two_threads_do_not_meet() -> None:
    async def meet() -> None:
        mine = running_loop()
        found: list[asyncio.AbstractEventLoop] = []
        other = threading.Thread(target=lambda: found.append(asyncio.run(both_agree())))
        other.start()
        other.join()
        assert found[0] is not mine
        assert running_loop() is mine

    asyncio.run(meet())


def test_a_process_forked_inside_a_loop_has_none() -> None:
    def loop_in_a_child() -> int:
        child = os.fork()
        if not child:
            try:
                running_loop()
            except RuntimeError:
                os._exit(0)
            os._exit(1)
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

    async def forked() -> int:
        running_loop()
        return loop_in_a_child()

    assert asyncio.run(forked()) == 0

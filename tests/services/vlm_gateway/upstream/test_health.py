"""Whom failures stop: everybody where the server is gone, one caller where it may be that caller's requests."""

from contextlib import closing

from services.vlm_gateway.upstream.health import FAILURES, Call, ServerHealth


def test_a_server_that_can_t_be_reached_is_left_alone_by_everybody() -> None:
    health = ServerHealth()
    for _ in range(FAILURES):
        assert health.allow("a")
        health.failure("a", "server")
    assert not health.allow("b")
    assert health.wait_s("b") > 0


def test_one_caller_s_requests_stop_that_caller_and_nobody_else() -> None:
    health = ServerHealth()
    for _ in range(4 * FAILURES):
        if health.allow("a"):
            health.failure("a", "request")
    assert not health.allow("a")
    assert health.allow("b")
    assert (health.state, health.stopped_callers) == ("closed", ["a"])
    health.failure("b", "request")  # one request of b's own that fails too
    assert health.allow("b")


def test_failures_that_several_callers_meet_are_the_server_s() -> None:
    health = ServerHealth()
    for caller in "abababab":
        if health.allow(caller):
            health.failure(caller, "request")
    assert health.state == "open"
    assert not health.allow("c")


def test_without_keys_everybody_is_one_caller() -> None:
    health = ServerHealth()
    for _ in range(FAILURES):
        health.failure("", "request")
    assert (health.state, health.allow("")) == ("open", False)


def test_a_success_forgives_and_a_call_that_was_given_up_frees_the_probe() -> None:
    health = ServerHealth(failures=1, pause_s=0.0)
    health.failure("a", "server")
    with closing(Call(health, "a")):
        assert health.allow("a")
        assert health.state == "half_open"
    assert health.allow("b")  # the probe ended undecided, so another may try at once
    with closing(Call(health, "b")) as call:
        call.succeeded()
        call.failed("server")  # what became of a call is told once
    assert health.state == "closed"


def test_a_stream_that_begins_to_speak_lets_the_others_in_and_one_more_failure_keeps_them_out() -> None:
    health = ServerHealth(failures=3, pause_s=60.0)
    for _ in range(3):
        health.failure("a", "server")
    with closing(Call(health, "a")) as call:
        call.brought_content()
        assert health.allow("b")
        call.failed("server")
    assert not health.allow("b")

"""How deliveries stand in the engine's queues."""

from orchestrator.engine import rank

NOW = 1_800_000_000.0


def test_a_higher_priority_goes_first_and_of_equal_ones_the_older() -> None:
    order = [rank(9, NOW + 60), rank(1, NOW), rank(0, NOW), rank(0, NOW + 60)]
    assert order == sorted(order)
    assert len(set(order)) == len(order)


def test_every_rank_is_one_that_the_engine_takes() -> None:
    for created in (0.0, NOW, NOW + 1e9, 1e12):
        for priority in (0, 9):
            assert 1 <= rank(priority, created) < 2**31

"""What is kept up to a bound."""

from orchestrator.newest import Newest


def test_the_oldest_is_forgotten_where_there_are_more_than_may_be() -> None:
    kept: Newest[int, str] = Newest(2)
    for number in range(5):
        kept[number] = str(number)
    assert dict(kept) == {3: "3", 4: "4"}

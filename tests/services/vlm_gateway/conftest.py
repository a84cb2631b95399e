"""A mock model server for the gateway's tests."""

from collections.abc import Iterator

import pytest

from tests.services.vlm_gateway.openai_mock import OpenAiMock, says


@pytest.fixture(scope="module")
def running_mock() -> Iterator[OpenAiMock]:
    mock = OpenAiMock().start()
    yield mock
    mock.stop()


@pytest.fixture
def mock(running_mock: OpenAiMock) -> OpenAiMock:
    """A mock that says hello until told otherwise."""
    running_mock.will(says("hello"))
    return running_mock

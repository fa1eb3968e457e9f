"""Fixtures of the tests that run nodes."""

from collections.abc import Iterator

import pytest
from graph import Graph


@pytest.fixture
def graph(ros_domain: int) -> Iterator[Graph]:
    """An empty ROS graph of the test's own."""
    made = Graph(ros_domain)
    yield made
    made.close()

"""Fixtures that every test may use."""

import os
import resource
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import domain_coordinator
import hypothesis
import pytest
from recorded import record_match

if TYPE_CHECKING:
    from graph import Graph

ROOT = Path(__file__).resolve().parents[1]

hypothesis.settings.register_profile("keepaway", deadline=None)  # a busy machine is no fault
hypothesis.settings.load_profile("keepaway")

# With this set, every program that a test starts compiles all that it imports: 1.5 s of a node's 2.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# A shell lets its background jobs ignore Ctrl-C, nohup a closed terminal, and whatever they start
# does so too: not what tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.hookimpl(tryfirst=True)  # before xdist looks at the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep the tests that run nodes on one worker: two ROS graphs at once would both be late.

    A file that names a group of its own stays out of theirs.
    """
    for item in items:
        of_nodes = {"ros", "nodes"} & set(item.path.relative_to(ROOT).parts[1:-1])
        if of_nodes and not item.get_closest_marker("xdist_group"):
            item.add_marker(pytest.mark.xdist_group("ros"))


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout's folder."""
    return ROOT


@pytest.fixture
def full_disk() -> Iterator[Callable[[int], None]]:
    """Lets no file of this process grow beyond N bytes, as if the disk were full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain that no other test on this machine has, for this process and its children."""
    with domain_coordinator.domain_id() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield domain


@pytest.fixture
def graph(ros_domain: int) -> "Iterator[Graph]":
    """An empty ROS graph of the test's own."""
    from graph import Graph  # only tests that use nodes wait for rclpy

    made = Graph(ros_domain)
    yield made
    made.close()


@pytest.fixture(scope="session")
def bag_3v2(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of four episodes of 3v2, recorded without ROS."""
    return record_match(tmp_path_factory.mktemp("bags") / "match_3v2", "3v2", seed=7, episodes=4)

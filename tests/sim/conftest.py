"""What tests of recordings share: a match that was recorded without ROS."""

from pathlib import Path

import pytest
from recorded import record_match


@pytest.fixture(scope="session")
def bag_3v2(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of four episodes of 3v2."""
    return record_match(tmp_path_factory.mktemp("bags") / "match_3v2", "3v2", seed=7, episodes=4)

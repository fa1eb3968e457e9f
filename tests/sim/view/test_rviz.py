"""RViz: its configuration shows topics that there are, with their types, frame and qualities."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from visualization_msgs.msg import MarkerArray

from keepaway_sim.ros.publishing import TOPICS
from keepaway_sim.task import Task
from keepaway_sim.wire.markers import field_markers
from keepaway_sim.wire.messages import FRAME

CONFIG = Path(__file__).resolve().parents[3] / "src/keepaway_sim/rviz/keepaway.rviz"


def test_the_configuration_shows_the_markers_as_they_are_published() -> None:
    manager = yaml.safe_load(CONFIG.read_text())["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == FRAME
    by_class = {each["Class"]: each for each in manager["Displays"]}
    topic = by_class["rviz_default_plugins/MarkerArray"]["Topic"]
    message_class, _, qos = TOPICS[topic["Value"]]
    assert message_class is MarkerArray
    assert qos.reliability == ReliabilityPolicy[topic["Reliability Policy"].upper()]
    assert qos.durability == DurabilityPolicy[topic["Durability Policy"].upper()]


def test_the_ball_is_seen_from_above_wherever_it_is() -> None:
    task = Task.parse("3v2")
    everybody_at_the_ball = np.zeros((task.num_players + 1, 2))
    markers = field_markers(task, everybody_at_the_ball, np.zeros(task.num_players))

    def top(marker: dict[str, Any]) -> float:
        return float(marker["pose"]["position"]["z"] + marker["scale"]["z"] / 2)

    (ball,) = (marker for marker in markers if marker["ns"] == "ball")
    assert top(ball) > max(top(marker) for marker in markers if marker["ns"] == "body")

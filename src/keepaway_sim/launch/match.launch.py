"""Starts a whole match with an ordinary ROS 2.

ros2 launch keepaway_sim match.launch.py task:=4v3 keeper_policy:=learn speed:=1.0
"""

from ament_index_python import get_package_share_path
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {
    "task": ("3v2", "keepers v takers"),
    "keeper_policy": ("hand", "random, hold, hand, learn or greedy"),
    "taker_policy": ("hand", "hand, random, learn or greedy"),
    "seed": ("0", "every random number of the match follows from it"),
    "speed": ("1.0", "simulated time over wall time; 0 plays as fast as the players answer"),
    "namespace": ("", "of every node and topic of the match"),
}

PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


def match_nodes(context: LaunchContext) -> list[Node]:
    """Return the simulator's node and one node for each player of the task."""
    chosen = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    num_keepers, num_takers = (int(count) for count in chosen["task"].split("v"))
    seed = int(chosen["seed"])

    def players(role: str, count: int) -> list[Node]:
        return [
            Node(
                package="keepaway_agent",
                executable=role,
                name=f"{role}_{number}",
                namespace=chosen["namespace"],
                parameters=[{"policy": chosen[f"{role}_policy"]}],
            )
            for number in range(1, count + 1)
        ]

    simulator = Node(
        package="keepaway_sim",
        executable="simulator",
        namespace=chosen["namespace"],
        parameters=[{"task": chosen["task"], "seed": seed, "speed": float(chosen["speed"])}],
    )
    return [simulator, *players("keeper", num_keepers), *players("taker", num_takers)]


def generate_launch_description() -> LaunchDescription:
    """Return the match as ros2 launch wants it."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    own = str(get_package_share_path("keepaway_sim") / "fastdds.xml")
    profiles = SetEnvironmentVariable(PROFILES, EnvironmentVariable(PROFILES, default_value=own))
    return LaunchDescription([*declared, profiles, OpaqueFunction(function=match_nodes)])

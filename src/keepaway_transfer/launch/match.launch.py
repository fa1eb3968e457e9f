"""Starts a whole match; ends with its simulator.

ros2 launch keepaway_transfer match.launch.py task:=4v3 keeper_policy:=learn speed:=1.0
ros2 launch keepaway_transfer match.launch.py --show-args
"""

from ament_index_python import get_package_share_path
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable, Shutdown
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node

from keepaway_sim.match.beginning import random_match_id
from keepaway_sim.settings import Setting, settings_of
from keepaway_transfer.bringup import BringUp, from_arguments, node_specs

PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


def match_nodes(context: LaunchContext) -> list[Node]:
    """Return the simulator's node and one node for each player of the task."""
    names = settings_of(BringUp)
    given = from_arguments({name: LaunchConfiguration(name).perform(context) for name in names})
    files = [given.params_file] if given.params_file else []
    return [
        Node(
            package=spec.package,
            executable=spec.executable,
            name=spec.name,
            namespace=given.namespace,
            parameters=[spec.parameters, *files],
            remappings=spec.remappings,
            output="screen",
            on_exit=Shutdown(reason="the match has ended") if spec.name == "simulator" else None,
        )
        for spec in node_specs(given, random_match_id())
    ]


def argument(setting: Setting) -> DeclareLaunchArgument:
    """Return a setting as an argument, with its unit, description and choices."""
    unit = f" [{setting.unit}]" if setting.unit else ""
    default = setting.default
    return DeclareLaunchArgument(
        setting.name,
        default_value=str(default).lower() if isinstance(default, bool) else str(default),
        description=f"{setting.text}{unit}",
        choices=list(setting.choices) or None,
    )


def generate_launch_description() -> LaunchDescription:
    """Return the match as ros2 launch wants it."""
    own = str(get_package_share_path("keepaway_sim") / "fastdds.xml")
    profiles = SetEnvironmentVariable(PROFILES, EnvironmentVariable(PROFILES, default_value=own))
    declared = [argument(setting) for setting in settings_of(BringUp).values()]
    return LaunchDescription([*declared, profiles, OpaqueFunction(function=match_nodes)])

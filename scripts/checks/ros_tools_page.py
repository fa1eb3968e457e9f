"""The page "With ordinary ROS tools": its text, its commands, and what each of them must print."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

PLAYERS = ("keeper_1", "keeper_2", "keeper_3", "taker_1", "taker_2")


class Step(NamedTuple):
    """A command and what it must do.

    Attributes:
        command: as a person types it.
        prints: patterns that its output must have.
        code: its exit code.
        lines: the number of lines that the page shows at most.
    """

    command: str
    prints: tuple[str, ...]
    code: int = 0
    lines: int = 40


class Section(NamedTuple):
    """A heading, a paragraph, and commands."""

    title: str
    text: str
    steps: tuple[Step, ...]


INTRODUCTION = """# With ordinary ROS tools

A match is an ordinary ROS 2 graph: `ros2`, `ros2 launch`, RViz and Foxglove work on it as on any other. This page is
written by `scripts/checks/ros_tools.py --write`, which runs every command below against a running match and checks
what it prints; `...` marks where an output is cut. An ordinary ROS 2 Jazzy has the tools (`source
/opt/ros/jazzy/setup.bash`); `scripts/checks/ros_tools.py --help` says how to install them beside the wheels of
`.venv`, which have none.
"""
TRIGGER = "std_srvs/srv/Trigger"
NAMES = tuple(rf"^/{name}$" for name in (*PLAYERS, "simulator"))
MATCH = Step(
    "ros2 launch keepaway_transfer match.launch.py speed:=1 keeper_policy:=learn save_weights:=weights",
    (r"keeper_1 is ready: learn", r"process has finished cleanly"),
    lines=16,
)
START = Section(
    "Start a match",
    "The launch file starts the simulator and one node for each player. Ctrl-C ends all of them; learners save first.",
    (MATCH,),
)
SECTIONS = (
    Section(
        "Nodes",
        "A player's node has the player's name.",
        (
            Step("ros2 node list", NAMES),
            Step(
                "ros2 node info /keeper_1", (r"/keeper_1/perception: keepaway_msgs/msg/Perception",)
            ),
        ),
    ),
    Section(
        "Topics",
        "Each player perceives on a topic of its own and answers on another. `match` and the statuses are latched:"
        " a late subscriber gets them too.",
        (
            Step(
                "ros2 topic list -t", (r"^/clock \[rosgraph_msgs/msg/Clock\]$", r"^/field_state \[")
            ),
            Step(
                "ros2 topic info -v /keeper_1/perception",
                (r"^Publisher count: 1$", r"^Subscription count: 1$", r"Reliability: RELIABLE"),
            ),
            Step("ros2 topic echo --once /match", (r"^task: 3v2$", r"^- keeper_1$"), lines=60),
            Step("ros2 topic echo --once /keeper_1/status", (r"^policy: learn$", r"^ready: true$")),
            Step(
                "ros2 interface show keepaway_msgs/msg/ActionRequest",
                (r"uint8 HOLD_BALL",),
                lines=60,
            ),
        ),
    ),
    Section(
        "Rates and delays",
        "At `speed:=1` a cycle takes 0.1 s, so 10 messages a second pass on every topic of the cycle. Stamps are simulated time: with `-s` `delay` takes `/clock` as its clock.",
        (
            Step(
                "timeout -s INT 8 ros2 topic hz /field_state",
                (r"average rate: (9\.[5-9]|10\.)",),
                124,
                2,
            ),
            Step(
                "timeout -s INT 8 ros2 topic hz /markers",
                (r"average rate: (9\.[5-9]|10\.)",),
                124,
                2,
            ),
            Step(
                "timeout -s INT 8 ros2 topic delay -s /field_state",
                (r"average delay: -?0\.[01]",),
                124,
                2,
            ),
        ),
    ),
    Section(
        "Services",
        "A match can be paused, resumed and reset; a learner saves and loads weights under its `weights_dir`.",
        (
            Step("ros2 service list -t | grep -v parameter", (r"^/simulator/pause \[",)),
            Step(f"ros2 service call /simulator/pause {TRIGGER}", (r"message='pauses'",)),
            Step(f"ros2 service call /simulator/start {TRIGGER}", (r"message='plays'",)),
            Step(f"ros2 service call /simulator/reset {TRIGGER}", (r"kicks off the next one",)),
            Step(
                'ros2 service call /keeper_1/save_weights keepaway_msgs/srv/SaveWeights "{path: ../elsewhere.npz}"',
                (r"success=False", r"set weights_dir"),
            ),
        ),
    ),
    Section(
        "Parameters",
        "Every parameter describes itself: type, sentence, unit, range. Those that may change while the match is"
        " running take a whole number for a double and refuse what is out of range; the others are read-only, and"
        " `load` refuses each of them. With a dumped file the same simulator is started again, here in another domain.",
        (
            Step("ros2 param list /keeper_1", (r"^  alpha$", r"^  weights_dir$")),
            Step(
                "ros2 param describe /simulator speed visible_angle_deg",
                (
                    r"name: speed\n  Type: double",
                    r"name: visible_angle_deg\n  Type: double\n  .*\[deg\]",
                ),
            ),
            Step("ros2 param set /simulator speed 2", ("^Set parameter successful$",)),
            Step("ros2 param get /simulator speed", (r"^Double value is: 2\.0$",)),
            Step(
                "ros2 param set /simulator speed -1",
                (r"out of range Min: 0\.0, Max: 10000\.0, value: -1",),
            ),
            Step("ros2 param set /simulator visible_angle_deg 90", (r"read-only",)),
            Step(
                "ros2 param dump /simulator > simulator.yaml; head -n 5 simulator.yaml",
                ("ros__parameters:",),
            ),
            Step(
                "ros2 param load /simulator simulator.yaml 2> refused.txt; head -n 2 refused.txt",
                (r"^Set parameter speed successful$", r"^Set parameter answer_timeout successful$"),
            ),
            Step(
                "ROS_DOMAIN_ID=46 timeout -s INT 30 ros2 run keepaway_sim simulator --ros-args --params-file simulator.yaml",
                (r"waits for keeper_1, keeper_2, keeper_3, taker_1, taker_2",),
                124,
                2,
            ),
            Step(
                "ros2 run keepaway_sim simulator --ros-args --params-file simulator.yaml",
                (r"^simulator: another simulator publishes `match` here \(3v2\): choose another",),
                1,
            ),
        ),
    ),
    Section(
        "Programs",
        "`ros2 run` starts a node alone. Arguments are ROS's: any other is refused.",
        (
            Step("ros2 pkg executables keepaway_sim", (r"^keepaway_sim simulator$",)),
            Step(
                "ros2 run keepaway_sim simulator --help",
                (r"^usage: simulator", r"visible_angle_deg"),
                lines=12,
            ),
            Step(
                "ros2 run keepaway_agent keeper --policy learn",
                (r"^keeper: --policy learn: not understood",),
                1,
            ),
            Step(
                "ros2 run keepaway_sim simulator --ros-args -p speed:=-1",
                (r"^simulator: speed=-1\.0: give a number from 0 to 10000",),
                1,
            ),
        ),
    ),
    Section(
        "Launch",
        "Every argument has a sentence, its unit and its choices. With `namespace:=a` all of a match, its clock"
        " included, is under `/a`, so two matches run side by side (`scripts/checks/two_launches.py` tries it).",
        (
            Step(
                "ros2 launch keepaway_transfer match.launch.py --show-args",
                (r"'keeper_policy':", r"Valid choices are: .*'greedy'"),
                lines=200,
            ),
            Step(
                "ros2 launch keepaway_transfer match.launch.py task:=three",
                (r"task or field: ",),
                1,
            ),
        ),
    ),
    Section(
        "RViz and Foxglove",
        "`rviz2 -d $(ros2 pkg prefix --share keepaway_sim)/rviz/keepaway.rviz` shows players and ball from `/markers`;"
        " `foxglove/keepaway.json` beside it is a layout for Foxglove. Every stamp and marker is in the frame `field`,"
        " which is RViz's fixed frame there, so no transform is needed, and the simulator publishes none: `tf2_msgs` has"
        " no wheel. Where a match is part of a larger tree, `ros2 run tf2_ros static_transform_publisher --frame-id map"
        " --child-frame-id field` joins it.",
        (),
    ),
    Section(
        "The standard simulation interfaces",
        "The simulator does not offer the services of `simulation_interfaces`. The package has no wheel; it builds from"
        " its definitions as `keepaway_msgs` does (version 1.5.1 with `msgs/pyproject.toml` and `msgs/cmake`), but a"
        " copy of them would have to be kept here. What they ask for and what there is: `SetSimulationState` and"
        " `GetSimulationState`: `~/start`, `~/pause` and the state in `/diagnostics`; `ResetSimulation` with"
        " `SCOPE_STATE`: `~/reset`; its `SCOPE_TIME`: nothing, time only goes forward; `StepSimulation`: nothing, a"
        " match cannot play N cycles and pause; entities: they are the players, read from `/field_state`, and never"
        " spawned, moved or deleted from outside.",
        (),
    ),
)


def page(outputs: Sequence[Sequence[str]]) -> str:
    """The page; outputs are the start's and then each section's, a text for every command."""
    parts = [INTRODUCTION]
    for section, texts in zip((START, *SECTIONS), outputs, strict=True):
        parts.append(f"## {section.title}\n{section.text}\n")
        for step, text in zip(section.steps, texts, strict=True):
            parts.append(f"```\n$ {step.command}\n{text}\n```\n")
    return "\n".join(parts)

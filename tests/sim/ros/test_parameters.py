"""Declared settings as ROS parameters: described, converted, kept within their ranges."""

from collections.abc import Callable, Iterator
from typing import Any

import attrs
import pytest
import rclpy
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter

from keepaway_sim.cli.options import ros_arguments
from keepaway_sim.errors import SettingError
from keepaway_sim.ros.parameters import declare_settings, warn_of_unknown
from keepaway_sim.settings import setting

MakeNode = Callable[[dict[str, Any]], Node]


@attrs.frozen
class Wish:
    """For the tests."""

    speed: float = setting(1.0, "simulated over wall time", "1", "[0, 1000]", was=("pace",))
    share: float = setting(0.5, "of all", "1", "(0, 1)")
    count: int = setting(3, "of them", "players", "[1, inf)")
    profile: str = setting("2005", "of the constants", choices=("2005", "v19"))
    loud: bool = setting(False, "or not")


@pytest.fixture
def make_node(ros_domain: int) -> Iterator[MakeNode]:
    """Makes a node that was started with parameters."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)

    def make(parameters: dict[str, Any]) -> Node:
        return Node(
            "wishing",
            context=context,
            cli_args=ros_arguments(parameters),
            use_global_arguments=False,
        )

    yield make
    rclpy.shutdown(context=context)


def test_every_parameter_has_its_own_descriptor(make_node: MakeNode) -> None:
    node = make_node({})
    assert declare_settings(node, Wish) == Wish()
    speed, share, count, profile, loud = node.describe_parameters(
        ["speed", "share", "count", "profile", "loud"]
    )
    assert speed.description == "simulated over wall time [1]"
    assert speed.type == ParameterType.PARAMETER_DOUBLE
    assert [(r.from_value, r.to_value) for r in speed.floating_point_range] == [(0.0, 1000.0)]
    assert share.additional_constraints == "give a number above 0 and below 1 [1]"
    assert [(r.from_value, r.to_value) for r in count.integer_range] == [(1, 2**63 - 1)]
    assert profile.additional_constraints == "give 2005 or v19"
    assert loud.type == ParameterType.PARAMETER_BOOL
    assert all(each.read_only for each in (speed, share, count, profile, loud))


@pytest.mark.parametrize(
    ("given", "made"),
    [
        ({"speed": 2}, Wish(speed=2.0)),
        ({"count": 4.0}, Wish(count=4)),
        ({"profile": 2005}, Wish()),
        ({"pace": 3}, Wish(speed=3.0)),
        ({"loud": True, "profile": "v19"}, Wish(loud=True, profile="v19")),
    ],
)
def test_values_are_taken_as_they_are_declared(
    make_node: MakeNode, given: dict[str, Any], made: Wish
) -> None:
    node = make_node(given)
    assert declare_settings(node, Wish) == made
    assert {name: node.get_parameter(name).value for name in attrs.asdict(made)} == (
        attrs.asdict(made)
    )
    assert not node.has_parameter("pace")


@pytest.mark.parametrize(
    ("given", "refusal"),
    [
        ({"speed": 1e308}, r"speed=1e\+308: give a number from 0 to 1000"),
        ({"speed": "fast"}, "speed='fast': give a number"),
        ({"share": 1.0}, "share=1.0: give a number above 0 and below 1"),
        ({"count": 0}, "count=0: give a whole number from 1"),
        ({"profile": 1999}, "profile='1999': give 2005 or v19"),
        ({"loud": "no way"}, "loud='no way': give true or false"),
    ],
)
def test_absurd_values_are_refused_with_what_may_be_given(
    make_node: MakeNode, given: dict[str, Any], refusal: str
) -> None:
    with pytest.raises(SettingError, match=refusal):
        declare_settings(make_node(given), Wish)


@attrs.frozen
class Needy:
    """Settings that do without no value."""

    path: str = setting("", "of a file")

    def __attrs_post_init__(self) -> None:
        if not self.path:
            raise SettingError("path is not set")


def test_settings_may_have_no_default_that_holds(make_node: MakeNode) -> None:
    assert declare_settings(make_node({"path": "a"}), Needy) == Needy("a")
    with pytest.raises(SettingError, match="path is not set"):
        declare_settings(make_node({}), Needy)


def test_other_defaults_may_hold(make_node: MakeNode) -> None:
    node = make_node({"count": 5})
    assert declare_settings(node, Wish, default=Wish(speed=7.0)) == Wish(speed=7.0, count=5)


def test_some_may_be_changed_while_the_node_runs(make_node: MakeNode) -> None:
    node = make_node({})
    seen: list[Wish] = []
    declare_settings(node, Wish, ("speed", "share"), seen.append)
    done = node.set_parameters([Parameter("speed", value=4), Parameter("share", value=0.25)])
    assert all(each.successful for each in done)
    assert seen[-1] == Wish(speed=4.0, share=0.25)
    assert node.get_parameter("speed").value == 4.0


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("speed", 2000.0, "range"),
        ("share", 1.0, "share=1.0: give a number above 0 and below 1"),
        ("speed", "fast", "type"),
        ("count", 4, "read-only"),
    ],
)
def test_changes_that_are_refused_change_nothing(
    make_node: MakeNode, name: str, value: Any, reason: str
) -> None:
    node = make_node({})
    seen: list[Wish] = []
    declare_settings(node, Wish, ("speed", "share"), seen.append)
    (done,) = node.set_parameters([Parameter(name, value=value)])
    assert not done.successful
    assert reason in done.reason
    assert seen == []
    assert node.get_parameter(name).value == getattr(Wish(), name)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("profle", "nothing reads the parameter profle: did you mean profile?"),
        ("xyzzy", "nothing reads the parameter xyzzy: --help lists those that there are"),
    ],
)
def test_a_parameter_that_nothing_reads_is_warned_of(
    make_node: MakeNode, capfd: pytest.CaptureFixture[str], given: str, said: str
) -> None:
    node = make_node({given: 1})
    declare_settings(node, Wish)
    warn_of_unknown(node, (Wish,))
    assert said in capfd.readouterr().err


def test_parameters_that_are_read_are_not_warned_of(
    make_node: MakeNode, capfd: pytest.CaptureFixture[str]
) -> None:
    node = make_node({"pace": 2.0, "count": 4, "use_sim_time": False})
    declare_settings(node, Wish)
    warn_of_unknown(node, (Wish,))
    assert "nothing reads" not in capfd.readouterr().err

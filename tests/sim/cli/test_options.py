"""Command lines and ROS arguments made of a dataclass."""

import argparse
from dataclasses import dataclass

import pytest

from keepaway_sim.cli.options import add_options, numbers_in, parse_node_arguments, ros_arguments
from keepaway_sim.errors import KeepawayError


@dataclass
class Wish:
    """For the tests."""

    speed: float = 1.0  # times 100% of real time
    lambda_: float = 0.0  # decay
    name_of: str = ""  # whose
    count: int = 3
    loud: bool = False  # or not


@pytest.fixture
def parser():
    made = argparse.ArgumentParser()
    made.add_argument("--name", default="")
    add_options(made, Wish)
    return made


def test_a_field_is_an_option_with_its_comment_as_help(parser):
    text = " ".join(parser.format_help().split())
    assert "--speed FLOAT times 100% of real time (default 1.0)" in text
    assert "--lambda FLOAT decay (default 0.0)" in text


def test_only_what_is_given_becomes_a_parameter(parser):
    made = parse_node_arguments(parser, ["--speed", "2", "--loud", "true", "--name", "keeper_2"])
    assert made == ["--ros-args", "-r", "__node:=keeper_2", "-p", "speed:=2.0", "-p", "loud:=true"]


def test_what_follows_ros_args_is_passed_on(parser):
    made = parse_node_arguments(parser, ["--count", "1", "--ros-args", "-r", "__ns:=/m"])
    assert made == ["--ros-args", "-p", "count:=1", "--ros-args", "-r", "__ns:=/m"]


@pytest.mark.parametrize("wrong", [["--loud", "yes"], ["--speed", "fast"], ["--velocity", "1"]])
def test_what_is_no_option_or_value_is_refused(parser, wrong, capsys):
    with pytest.raises(SystemExit):
        parse_node_arguments(parser, wrong)
    assert wrong[0] in capsys.readouterr().err


def test_texts_that_look_like_numbers_stay_texts():
    assert ros_arguments({"profile": "2005"})[-1] == 'profile:="2005"'


@pytest.mark.parametrize("text", ["", "x", "3-", "1;2"])
def test_numbers_that_are_none_are_refused(text):
    with pytest.raises(KeepawayError, match="write numbers like"):
        numbers_in(text)

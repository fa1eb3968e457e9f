"""Command lines and ROS arguments made of declared settings."""

import argparse

import attrs
import pytest

from keepaway_sim.cli.options import (
    add_options,
    chosen,
    numbers_in,
    parse_node_arguments,
    ros_arguments,
)
from keepaway_sim.errors import KeepawayError
from keepaway_sim.settings import group, setting


@attrs.frozen
class Learner:
    """For the tests."""

    lambda_: float = setting(0.0, "decay", range="[0, 1]")


@attrs.frozen
class Wish:
    """For the tests."""

    speed: float = setting(1.0, "times 100% of real time", "1")
    angle_deg: float = setting(90.0, "of vision", "deg", was=("angle",))
    learner: Learner = group(Learner)
    name_of: str = setting("", "whose", choices=("", "me", "you"))
    count: int = setting(3, "of them")
    loud: bool = setting(False, "or not")


@pytest.fixture
def parser():
    made = argparse.ArgumentParser()
    made.add_argument("--name", default="")
    add_options(made, Wish)
    return made


def test_a_setting_is_an_option_with_sentence_unit_and_default(parser):
    text = " ".join(parser.format_help().split())
    assert "--speed FLOAT times 100% of real time [1] (default 1.0)" in text
    assert "--lambda FLOAT decay (default 0.0)" in text
    assert '--name-of |me|you whose (default "")' in text


def test_only_what_is_given_becomes_a_parameter(parser):
    made = parse_node_arguments(parser, ["--speed", "2", "--loud", "true", "--name", "keeper_2"])
    assert made == ["--ros-args", "-r", "__node:=keeper_2", "-p", "speed:=2.0", "-p", "loud:=true"]


def test_what_follows_ros_args_is_passed_on(parser):
    made = parse_node_arguments(parser, ["--count", "1", "--ros-args", "-r", "__ns:=/m"])
    assert made == ["--ros-args", "-p", "count:=1", "--ros-args", "-r", "__ns:=/m"]


@pytest.mark.parametrize(
    ("words", "made"),
    [
        ([], Wish()),
        (["--loud"], Wish(loud=True)),
        (["--loud", "false"], Wish()),
        (["--lambda", "0.5"], Wish(learner=Learner(0.5))),
        (["--angle-deg", "45"], Wish(angle_deg=45.0)),
        (["--angle", "45"], Wish(angle_deg=45.0)),
    ],
)
def test_settings_are_chosen_by_options_of_old_and_new_names(parser, words, made):
    assert chosen(Wish, parser.parse_args(words)) == made


def test_a_value_out_of_range_is_refused_when_the_settings_are_made(parser):
    with pytest.raises(KeepawayError, match=r"lambda_=2.0: give a number from 0 to 1"):
        chosen(Wish, parser.parse_args(["--lambda", "2"]))


def test_some_options_may_be_left_out_and_have_their_defaults_in_the_namespace():
    made = argparse.ArgumentParser()
    add_options(made, Wish, only=("count", "loud"), without=("loud",), with_defaults=True)
    assert vars(made.parse_args([])) == {"count": 3}


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

"""How a node's process begins and ends: its arguments, signals, errors in one line, exit code 1.

The packages of the world and of the agents share no code, so each has this same file; a contract
test holds the two together.
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import signal
import sys
from collections.abc import Callable, Collection, Iterable, Sequence
from types import FrameType

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from keepaway_agent.settings import settings_of

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
LONGEST_EXIT = 15.0  # [s] the middleware's own end was once seen to hang


class StoppedCompiling(KeyboardInterrupt):
    """A signal came while machine code was made: it is given up at once, as nothing is lost."""


Play = Callable[[Callable[[], bool]], None]
"""What a node does, until the function that it is given returns true: it should end."""


def run_node(
    name: str,
    play: Play,
    settings: Sequence[type],
    refusal: type[Exception],
    args: list[str] | None = None,
) -> None:
    """Run a node until it has finished or a signal asks it to end (SIGINT, SIGTERM).

    Signals are only noted: nothing is interrupted halfway, but for compiling.

    Args:
        name: of the node.
        play: makes the node and plays it.
        settings: the classes of its parameters, for `--help`.
        refusal: raised by `play` where the node cannot run, with a message for a person.
        args: the command line without the program's name; None: the process's.

    Raises:
        SystemExit: with one line and exit code 1 where it cannot run; or after `--help`.
    """
    check_arguments(name, settings, sys.argv[1:] if args is None else args)
    received = received_signals(_SIGNALS)
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        gc.freeze()  # what has been imported stays: no collection looks at it again
        play(lambda: bool(received))
    except (refusal, ParameterException) as error:
        raise SystemExit(f"{name}: {error}") from error
    except KeyboardInterrupt:  # StoppedCompiling, or what a compiling child makes of a Ctrl-C
        print(f"{name}: stopped while it compiled", file=sys.stderr)  # noqa: T201
    finally:
        end_ros()
        ignore_signals(_SIGNALS)


def end_ros() -> None:
    """End ROS in a program that has nothing left to do: everything is saved and told.

    Where the middleware hangs, its stacks are printed and it ends with 1 after `LONGEST_EXIT`.
    A program may have been started without a standard output, or without one for errors.
    """
    with contextlib.suppress(OSError):  # whoever read it may be gone
        print(end="", flush=True)  # noqa: T201
    if sys.stderr:
        faulthandler.dump_traceback_later(LONGEST_EXIT, exit=True)
    rclpy.try_shutdown()


def received_signals(numbers: Collection[int]) -> list[int]:
    """The signals that come from now on, in their order; of those numbers, but for ignored ones.

    They are noted and raise nothing; only the first raises `StoppedCompiling` where the
    program compiles, which may take a minute. A list, not an `Event`: what a handler sets may
    wait for a lock that the code holds which it interrupts, and neither would ever go on.
    """
    received: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        received.append(number)
        if len(received) == 1 and _is_compiling(frame):
            ignore_signals(numbers)
            raise StoppedCompiling

    for number in numbers:
        if signal.getsignal(number) is not signal.SIG_IGN:  # nohup stays nohup
            signal.signal(number, note)
    return received


def ignore_signals(numbers: Iterable[int]) -> None:
    """Let a program that is ending end; Python itself would let its last moments be cut short."""
    for number in numbers:
        signal.signal(number, signal.SIG_IGN)


def _is_compiling(frame: FrameType | None) -> bool:
    """Whether `compiled.prepare` waits for machine code, seen from where a signal came in."""
    while frame:
        code = frame.f_code
        if code.co_name == "prepare" and code.co_filename.endswith("compiled.py"):
            return True
        frame = frame.f_back
    return False


def check_arguments(name: str, settings: Sequence[type], args: Sequence[str]) -> None:
    """Answer `--help`, and refuse what is not ROS's, or what ROS itself does not understand.

    Raises:
        SystemExit: after the help (0), or because of an argument that nothing would read (1).
    """
    try:
        own = remove_ros_args(["", *args])[1:]
    except RuntimeError as error:  # behind the reason: a place in the C sources
        reason = str(error).removeprefix("Failed to parse ROS arguments: ").partition(", at /")[0]
        raise SystemExit(f"{name}: not understood after --ros-args: {reason}") from error
    if {"-h", "--help"} & set(own):
        print(usage(name, settings))  # noqa: T201
        raise SystemExit(0)
    if own:
        raise SystemExit(
            f"{name}: {' '.join(own)}: not understood; parameters and names are given as"
            f" --ros-args -p NAME:=VALUE -r __node:=NAME, and --help lists them"
        )


def usage(name: str, settings: Sequence[type]) -> str:
    """The help text of a node: every parameter with its default, unit and sentence."""
    declared = [each for group in settings for each in settings_of(group).values()]
    wide = max((len(each.name) for each in declared), default=0)
    lines = [
        f"  {each.name:{wide}}  {each.text}{f' [{each.unit}]' if each.unit else ''}"
        f" (default {each.default!r})"
        for each in declared
    ]
    head = f"usage: {name} [--ros-args [-r __node:=NAME] [-r __ns:=/NAMESPACE] [-p NAME:=VALUE]..]"
    return "\n".join([head, "", "parameters:", *lines])
